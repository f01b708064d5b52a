// Build each page into one self-contained HTML file in the package: PAGE/PAGE.html.
//
// A page is a folder with page.html and main.ts. Style (the .css files that
// main.ts imports) and script replace <!-- conevo:style --> and <!-- conevo:script --> in page.html.
// Its content security policy names the script by its hash, so no other script in a page can run.
//
// With --check nothing is written: it fails if the files differ from those of a build. The package's
// folder may be given.

import { createHash } from "node:crypto";
import { existsSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { parseArgs } from "node:util";
import { build } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const { values, positionals } = parseArgs({
  options: { check: { type: "boolean" } },
  allowPositionals: true,
});
const folder = positionals[0] ?? join(here, "..", "src", "conevo");

for (const page of ["replay", "watch"]) {
  const html = await assemble(page);
  const path = join(folder, page, `${page}.html`);
  if (!values.check) {
    writeFileSync(path, html);
    console.log(`${page}.html: ${Buffer.byteLength(html)} bytes`);
  } else if (!existsSync(path) || readFileSync(path, "utf8") !== html) {
    console.error(`${path} is not what a build gives: run npm run build in viewer/`);
    process.exitCode = 1;
  }
}

/** Return the HTML of a page. */
async function assemble(page) {
  const bundle = await build({
    absWorkingDir: here,
    entryPoints: [`${page}/main.ts`],
    outdir: "out",
    bundle: true,
    write: false,
    minify: true,
    charset: "ascii",
    format: "iife",
    target: "es2022",
    legalComments: "inline",
    metafile: true,
    logLevel: "warning",
  });
  const output = (ending) =>
    bundle.outputFiles.find((file) => file.path.endsWith(ending))?.text.trim() ?? "";
  // A script or a style must not contain the text that ends it for the HTML parser.
  const script = (licences(bundle.metafile) + output(".js")).replace(
    /<(?=\/script|!--)/gi,
    "\\x3c",
  );
  const style = output(".css").replace(/<\/(?=style)/gi, "<\\/");
  const hash = createHash("sha256").update(script).digest("base64");
  const parts = {
    "conevo:hash": `'sha256-${hash}'`,
    "<!-- conevo:style -->": `<style>${style}</style>`,
    "<!-- conevo:script -->": `<script>${script}</script>`,
  };
  let html = readFileSync(join(here, page, "page.html"), "utf8");
  for (const [mark, text] of Object.entries(parts)) {
    if (html.split(mark).length !== 2) throw new Error(`${page}/page.html needs one ${mark}`);
    html = html.replace(mark, () => text);
  }
  return html;
}

/** Return a comment with the licences of the packages that are part of a bundle. */
function licences(metafile) {
  const inputs = Object.keys(metafile.inputs).map((path) =>
    /node_modules\/(@[^/]+\/[^/]+|[^/]+)/.exec(path),
  );
  const names = [...new Set(inputs.filter(Boolean).map((match) => match[1]))].sort();
  return names
    .map((name) => {
      const folder = join(here, "node_modules", name);
      const { version } = JSON.parse(readFileSync(join(folder, "package.json"), "utf8"));
      const text = readFileSync(join(folder, "LICENSE"), "utf8").trim();
      return `/*! ${name} ${version}\n${text}\n*/\n`;
    })
    .join("");
}
