// The methods side by side: for each environment a chart and a table.

import uPlot from "uplot";

import { make, say, swatch } from "../shared/dom";
import { Chart, options } from "./chart";
import { type Axis, colourOf, type Panel, type Quantity, type State, methodTitle } from "./state";
import { count, counts, number } from "./text";

export interface Choices {
  quantity: Quantity;
  axis: Axis;
}

/** The view of one panel. */
export class PanelView {
  readonly root: HTMLElement;
  private readonly chart = new Chart();
  private readonly heading = make("h3");
  private readonly hint = make("p", { class: "hint faint" });
  private readonly body = make("tbody");
  private readonly head = make("tr");
  private labels: string[] = []; // of the runs behind the chart's lines
  private names: string[] = []; // of all lines
  private of: number[][] = []; // of how many runs the medians are, behind the lines of the runs
  private focus = -1;

  constructor(show: (label: string) => void) {
    const table = make("table", { class: "standings" }, make("thead", {}, this.head), this.body);
    const rows = make("div", { class: "wide" }, table);
    this.root = make("article", { class: "panel" }, this.heading, this.chart.place, this.hint, rows);
    this.chart.place.addEventListener("click", () => {
      const label = this.labels[this.focus - 1];
      if (label !== undefined) show(label);
    });
  }

  draw(state: State, panel: Panel, choices: Choices): void {
    const several = state.groups.length > 1 && panel.group !== "";
    const parts = [panel.task, panel.variant, `preset ${panel.preset}`, several ? panel.group : ""];
    say(this.heading, parts.filter(Boolean).join(", "));
    this.drawTable(state, panel);
    this.drawChart(state, panel, choices);
  }

  private drawTable(state: State, panel: Panel): void {
    const measure = panel.measure || "performance";
    const head = [panel.by, "runs", `${measure} (median; ${panel.about})`, "lowest to highest", "fitness", "S", "evaluations"];
    this.head.replaceChildren(...head.map((text) => make("th", { scope: "col" }, text)));
    const sign = panel.larger_is_better ? 1 : -1; // the best first, and last what has come to nothing
    const rank = (value: number | null): number => (value === null ? -Infinity : sign * value);
    const rows = [...panel.rows].sort((a, b) => rank(b.performance) - rank(a.performance));
    this.body.replaceChildren(
      ...rows.map((row) => {
        const title = panel.by === "method" ? methodTitle(state, row.series) : row.series;
        const range = row.lowest === null ? "–" : `${number(row.lowest)} to ${number(row.highest)}`;
        const done = row.status.finished ?? 0;
        const more = ["running", "failed", "interrupted", "damaged"].filter((s) => row.status[s]);
        const text = [`${done}/${row.of}`, ...more.map((s) => `${row.status[s]} ${s}`)].join(", ");
        return make(
          "tr",
          { "data-series": row.series },
          make("th", { scope: "row" }, swatch(colourOf(state, panel, row.series)), title),
          make("td", { title: counts(row.status) }, text),
          make("td", { class: "main" }, number(row.performance)),
          make("td", {}, range),
          make("td", {}, number(row.fitness)),
          make("td", {}, number(row.specialization)),
          make("td", {}, row.evaluations === null ? "–" : count(row.evaluations)),
        );
      }),
    );
  }

  private drawChart(state: State, panel: Panel, choices: Choices): void {
    const curves = panel.over[choices.axis];
    const { quantity, axis } = choices;
    if (!curves.lines.length) {
      this.chart.say("No generation has finished yet.");
      return;
    }
    const medians = panel.rows.some((row) => row.of > 1) ? curves.medians : [];
    this.labels = curves.lines.map((line) => line.label);
    const title = (series: string): string => (panel.by === "method" ? methodTitle(state, series) : series);
    this.names = [...this.labels, ...medians.map((one) => `median of ${title(one.series)}`)];
    this.of = medians.map((one) => one[`${quantity}_runs`]);
    const colours = [...curves.lines, ...medians].map((one) => colourOf(state, panel, one.series));
    const isThin = (k: number): boolean => k < curves.lines.length && medians.length > 0;
    const many = Math.sqrt(Math.min(1, 30 / curves.lines.length)); // the more lines, the fainter
    const alpha = Math.max(20, Math.round(102 * many)).toString(16);
    const data = [curves.x, ...curves.lines.map((l) => l[quantity]), ...medians.map((m) => m[quantity])];
    const measure = quantity === "performance" ? `${panel.measure} (${panel.about})` : "fitness of the fittest team";
    const xLabel = axis === "evaluations" ? "team evaluations" : "generations";
    const key = JSON.stringify([quantity, axis, this.names, colours, measure]);
    this.chart.draw(key, data as uPlot.AlignedData, () => ({
      ...options(xLabel, measure, 230),
      legend: { show: false },
      focus: { alpha: 0.35 },
      cursor: { focus: { prox: 14 }, points: { show: false }, drag: { x: false, y: false } },
      hooks: {
        setSeries: [(_, at) => this.aim(at ?? -1)],
        setCursor: [(plot) => this.describe(plot, xLabel)],
      },
      series: [
        {},
        ...this.names.map((label, k) => ({
          label,
          stroke: isThin(k) ? `${colours[k]}${alpha}` : (colours[k] ?? "#000"),
          width: isThin(k) ? 1 : 3,
          points: { show: false },
        })),
      ],
    }));
    this.hint.textContent = this.hint.textContent || "\u00a0";
  }

  /** Remember the line at the pointer. */
  private aim(at: number): void {
    this.focus = at;
    this.chart.place.style.cursor = at > 0 && at <= this.labels.length ? "pointer" : "";
  }

  /** Show the line at the pointer, and its value there. */
  private describe(plot: uPlot, xLabel: string): void {
    const index = plot.cursor.idx;
    const name = this.focus > 0 ? this.names[this.focus - 1] : undefined;
    if (name === undefined || index === null || index === undefined) {
      say(this.hint, "\u00a0");
      return;
    }
    const value = plot.data[this.focus]?.[index];
    const x = plot.data[0][index] ?? 0;
    const of = this.of[this.focus - 1 - this.labels.length]?.[index];
    const runs = of === undefined ? "" : ` (of ${of} ${of === 1 ? "run" : "runs"})`;
    say(this.hint, `${name}${runs}: ${number(value)} at ${count(x)} ${xLabel}`);
  }
}
