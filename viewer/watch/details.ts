// One run: its state, and four charts over its generations.

import uPlot from "uplot";

import { find, make, say, swatch } from "../shared/dom";
import { Chart, FAINT, INK, options } from "./chart";
import { type Details, main, methodTitle, own, type State, type Summary, type Values } from "./state";
import { badge, casteBar, place, progressBar } from "./table";
import { clock, count, duration, left, number } from "./text";

const FIELDS = [
  ["status", "status"],
  ["generation", "generation"],
  ["eta", "time left"],
  ["performance", "task performance"],
  ["fitness", "fitness"],
  ["specialization", "specialization S"],
  ["castes", "castes by S"],
  ["favourites", "favourite settings"],
  ["thresholds", "SST, GST"],
  ["evaluations", "evaluations"],
  ["seconds", "time taken"],
  ["path", "folder"],
] as const;

/** The direction of the share of a favourite. */
const SHARE = "1 = always the same one";

/** The view of one run. */
export class DetailsView {
  private readonly root = find("details", HTMLElement);
  private readonly heading = make("h2");
  private readonly alert = make("p", { class: "alert", hidden: true });
  private readonly cells = new Map<string, HTMLElement>();
  private readonly replay = make("a", { class: "replay", target: "_blank", rel: "noopener" });
  private readonly measure = make("select", { "aria-label": "Measure of task performance" });
  private readonly performance = new Chart("chart-performance");
  private readonly fitness = new Chart("chart-fitness");
  private readonly castes = new Chart("chart-castes");
  private readonly thresholds = new Chart("chart-thresholds");
  private readonly legend = make("p", { class: "legend" });
  private data: Details | null = null;
  private state: State | null = null;

  constructor(close: () => void) {
    const list = make("dl");
    for (const [field, name] of FIELDS) {
      const cell = make("dd", { "data-field": field });
      this.cells.set(field, cell);
      list.append(make("dt", {}, name), cell);
    }
    this.measure.addEventListener("change", () => this.drawCharts());
    this.root.append(
      make("div", { class: "bar" }, this.heading, make("button", { type: "button", class: "close", onclick: close }, "Close")),
      this.alert,
      list,
      make("p", {}, this.replay),
      make(
        "div",
        { class: "charts" },
        figure("Task performance of the fittest team", this.performance, this.measure),
        figure("Fitness", this.fitness),
        figure("Castes of the fittest team", this.castes, this.legend),
        figure("Specialization and its thresholds", this.thresholds),
      ),
    );
  }

  hide(): void {
    this.root.hidden = true;
    this.data = null;
  }

  /** Show the state of a run. */
  drawSummary(run: Summary, state: State): void {
    this.state = state;
    this.root.hidden = false;
    this.root.dataset.label = run.label;
    say(this.heading, run.label);
    const title = [run.task, methodTitle(state, run.method), run.variant, run.preset && `preset ${run.preset}`];
    this.heading.title = title.filter(Boolean).join(", ");
    const problem = [run.problem, run.reason].filter(Boolean).join("; ");
    say(this.alert, problem);
    this.alert.hidden = !problem;
    const [measure, value] = main(run);
    const others = Object.entries(run.performance).slice(1).map(([name, v]) => `${name} ${number(v)}`);
    const pace = run.generation ? `, ${number(run.seconds / run.generation)} s per generation` : "";
    this.set("status", badge(run.status));
    this.set("generation", place(run), progressBar(run));
    const end = run.ends_at === null ? "" : ` (until ${clock(run.ends_at)})`;
    this.set("eta", run.ends_at === null ? "–" : `${left(run.ends_at)}${end}`);
    this.set("performance", measure ? [`${measure} ${number(value)}`, ...others].join(", ") : "–");
    this.set("fitness", `fittest team ${number(run.fitness)}, best genotype ${number(run.best)}`);
    this.set("specialization", number(run.specialization));
    const names = Object.entries(run.castes).map(([name, n]) => `${name} ${n}`);
    this.set("castes", casteBar(run, state), ` ${names.join(", ") || "–"}`);
    const liked = Object.entries(run.favourites).map(([name, n]) => `${name} ${n}`).join(", ");
    const share = `mean share ${number(run.favourite_share)}, ${SHARE}`;
    this.set("favourites", liked ? `${liked} (${share})` : "–");
    this.set("thresholds", `${number(run.sst)}, ${number(run.gst)}`);
    const budget = run.budget ? ` of ${count(run.budget)}` : "";
    this.set("evaluations", `${count(run.evaluations)}${budget}`);
    this.set("seconds", `${duration(run.seconds)}${pace}`);
    this.set("path", run.path);
    this.replay.hidden = run.champion === null;
    this.replay.href = `/replay/${encodeURIComponent(run.label)}`;
    const now = run.status === "finished" ? "" : " so far";
    const stage = run.champion_stage ? `stage ${run.champion_stage}, ` : "";
    say(this.replay, `Replay of the fittest team${now} (${stage}generation ${run.champion})`);
  }

  /** Draw all generations of the run. */
  drawGenerations(data: Details): void {
    this.data = data;
    const measures = Object.keys(data.measures);
    if (JSON.stringify(measures) !== JSON.stringify([...this.measure.options].map((o) => o.value))) {
      this.measure.replaceChildren(...measures.map((name) => make("option", { value: name }, titled(name, data))));
    }
    this.measure.hidden = measures.length < 2;
    this.drawCharts();
  }

  private set(field: string, ...content: (Node | string)[]): void {
    this.cells.get(field)?.replaceChildren(...content);
  }

  private drawCharts(): void {
    const { data, state } = this;
    if (!data || !state) return;
    if (!data.number.length) {
      for (const chart of [this.performance, this.fitness, this.castes, this.thresholds]) {
        chart.say("No generation has finished yet.");
      }
      this.legend.replaceChildren();
      return;
    }
    const name = this.measure.value;
    const [blue, orange, green] = state.palette;
    const column = (key: string): Values => data.columns[key] ?? [];
    this.lines(this.performance, titled(name, data), [[name, own(data.measures, name) ?? [], blue ?? INK]]);
    this.lines(this.fitness, "fitness", [
      ["fittest team", column("team_fitness"), blue ?? INK],
      ["best genotype", column("best_fitness"), orange ?? INK],
      ["mean of genotypes", column("mean_fitness"), green ?? INK],
    ]);
    const has = (key: string): boolean => column(key).some((value) => value !== null);
    const lines: Line[] = [["S (0 = always the same action, 1 = switches all the time)", column("specialization"), INK]];
    if (has("favourite_share")) {
      lines.push([`share of the favourite setting (${SHARE})`, column("favourite_share"), green]);
    }
    if (has("sst")) lines.push(["SST", column("sst"), blue, [6, 3]]);
    if (has("gst")) lines.push(["GST", column("gst"), orange, [2, 3]]);
    this.lines(this.thresholds, "", lines, [0, 1]);
    this.drawCastes(data, state);
  }

  /** Draw lines over the generations. */
  private lines(chart: Chart, yLabel: string, lines: Line[], range?: [number, number]): void {
    const data = this.data as Details;
    const values = [data.number, ...lines.map(([, y]) => y)];
    const key = JSON.stringify([yLabel, lines.map(([name]) => name), data.label, data.stages.length]);
    chart.draw(key, values as uPlot.AlignedData, () => ({
      ...this.base(yLabel, data, range),
      series: [
        this.xSeries(),
        ...lines.map(([label, , stroke, dash]) => ({
          label,
          stroke: stroke ?? INK,
          width: 1.8,
          ...(dash ? { dash } : {}),
          points: { show: data.number.length < 3, size: 5 },
          value: (plot: uPlot, value: number | null, k: number, at: number | null) =>
            number(at === null ? plot.data[k]?.at(-1) : value), // the last where none is pointed at
        })),
      ],
    }));
  }

  /** Draw the number of robots of each caste, as stacked areas. */
  private drawCastes(data: Details, state: State): void {
    const world = data.task.split("/")[0] ?? "";
    const colours = own(state.castes, world) ?? {};
    const unknown = Object.keys(data.robots).filter((name) => !Object.hasOwn(colours, name));
    const names = [...Object.keys(colours), ...unknown].filter((name) => own(data.robots, name));
    const robots = names.map((name) => own(data.robots, name) ?? []);
    const sums: number[][] = [];
    for (const values of robots) {
      const below = sums.at(-1);
      sums.push(values.map((value, k) => (value ?? 0) + (below?.[k] ?? 0)));
    }
    const shown = names.map((_, k) => names.length - 1 - k); // the highest is drawn first
    // A generation is as wide as the step to the next: the last one gets a step, too.
    const x = [...data.number, (data.number.at(-1) ?? 0) + 1];
    const ys = shown.map((k) => [...(sums[k] ?? []), sums[k]?.at(-1) ?? 0]);
    const colour = (k: number): string => own(colours, names[k] ?? "") ?? FAINT;
    const key = JSON.stringify([names, shown.map(colour), data.label, data.stages.length]);
    this.castes.draw(key, [x, ...ys] as uPlot.AlignedData, () => ({
      ...this.base("robots", data),
      legend: { show: false },
      hooks: { ...this.base("", data).hooks, setCursor: [(plot) => this.tellCastes(plot.cursor.idx ?? null)] },
      series: [
        this.xSeries(),
        ...shown.map((k) => ({
          label: names[k] ?? "",
          stroke: "#ffffff",
          width: 0.5,
          fill: colour(k),
          paths: uPlot.paths.stepped?.({ align: 1 }) as uPlot.Series.PathBuilder,
          points: { show: false },
        })),
      ],
    }));
    this.castesShown = { names, colours: names.map((_, k) => colour(k)) };
    this.tellCastes(null);
  }

  private castesShown: { names: string[]; colours: string[] } = { names: [], colours: [] };

  /** Write the legend of castes with their sizes in one generation, by default the last. */
  private tellCastes(index: number | null): void {
    const data = this.data;
    if (!data) return;
    const at = Math.min(index ?? data.number.length - 1, data.number.length - 1);
    const { names, colours } = this.castesShown;
    this.legend.replaceChildren(
      make("span", { class: "faint" }, `generation ${data.number[at] ?? 0}`),
      ...names.map((name, k) =>
        make("span", {}, swatch(colours[k] ?? FAINT), `${name} ${own(data.robots, name)?.[at] ?? 0}`),
      ),
    );
  }

  private xSeries(): uPlot.Series {
    return {
      label: "generation",
      value: (plot, value, _, at) => String((at === null ? plot.data[0].at(-1) : value) ?? "–"),
    };
  }

  /** Return the options of a chart over generations: all have the same, a common cursor. */
  private base(yLabel: string, data: Details, range?: [number, number]): uPlot.Options {
    const shared = options("generation", yLabel, 180);
    const end = (): number => (this.data?.number.at(-1) ?? 0) + 1;
    return {
      ...shared,
      scales: {
        x: { time: false, range: (_, low, high) => [low, low === 0 ? Math.max(high, end()) : high] },
        ...(range ? { y: { range } } : {}),
      },
      cursor: { ...(shared.cursor ?? {}), sync: { key: "generations", scales: ["x", null] } },
      hooks: { draw: [(plot) => markStages(plot, data.stages)] },
    };
  }
}

type Line = [name: string, values: Values, colour: string | undefined, dash?: number[]];

function figure(title: string, chart: Chart, ...more: HTMLElement[]): HTMLElement {
  return make("figure", {}, make("figcaption", {}, title, " ", ...more), chart.place);
}

/** Draw a line at the start of each stage of a shaping, with its number. */
function markStages(plot: uPlot, stages: Details["stages"]): void {
  const { ctx, bbox } = plot;
  ctx.save();
  ctx.strokeStyle = FAINT;
  ctx.fillStyle = INK;
  ctx.setLineDash([4, 4]);
  ctx.textAlign = "left";
  ctx.textBaseline = "alphabetic";
  ctx.font = `${10 * devicePixelRatio}px system-ui, sans-serif`;
  for (const { stage, first } of stages) {
    const x = plot.valToPos(first, "x", true);
    if (x < bbox.left || x > bbox.left + bbox.width) continue;
    ctx.beginPath();
    ctx.moveTo(x, bbox.top);
    ctx.lineTo(x, bbox.top + bbox.height);
    ctx.stroke();
    ctx.fillText(`stage ${stage}`, x + 4, bbox.top + 10 * devicePixelRatio);
  }
  ctx.restore();
}

/** Return a measure with its unit and direction, as far as they are known. */
function titled(name: string, run: Summary): string {
  const about = own(run.declared, name);
  return about ? `${name} (${about})` : name;
}
