// Formulas as HTML: reads a JSON list of {tex, display} and writes a JSON list of texts.
import { readFileSync } from "node:fs";
import katex from "katex";

const formulas = JSON.parse(readFileSync(0, "utf8"));
try {
  const html = formulas.map(({ tex, display }) =>
    katex.renderToString(tex, { displayMode: display, throwOnError: true, strict: "error" }),
  );
  process.stdout.write(JSON.stringify(html));
} catch (error) {
  process.stderr.write(`${error.message}\n`);
  process.exitCode = 1;
}
