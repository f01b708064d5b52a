// uPlot with the look of these pages.

import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";

import { make } from "../shared/dom";
import { number } from "./text";

export const INK = "#1c1c22";
export const FAINT = "#9a9aa5";
const GRID = { stroke: "#e7e5df", width: 1 };
const WHOLE = [...Array(9).keys()].flatMap((k) => [1, 2, 5].map((n) => n * 10 ** k)); // steps of ticks
const FONT = "11px system-ui, sans-serif";

/** Return what all charts have in common. */
export function options(xLabel: string, yLabel: string, height: number): uPlot.Options {
  const axis = { stroke: INK, grid: GRID, ticks: GRID, font: FONT, labelFont: FONT, labelSize: 18, labelGap: 0 };
  const ticks = (_: uPlot, splits: number[]): string[] => splits.map((split) => number(split));
  return {
    width: 300,
    height,
    scales: { x: { time: false } },
    axes: [
      { ...axis, label: xLabel, size: 30, values: ticks, space: 60, incrs: WHOLE },
      { ...axis, label: fitting(yLabel, height), size: 52, values: ticks },
    ],
    series: [],
    cursor: { points: { size: 6 }, drag: { x: true, y: false } },
    padding: [10, 22, 0, 0],
  };
}

/** Return a label that fits next to a chart of that height: without its direction, or its unit, if need be. */
function fitting(label: string, height: number): string {
  const pen = document.createElement("canvas").getContext("2d");
  if (!pen) return label;
  pen.font = FONT;
  const room = height - 50; // it is centred on the area between the upper rim and the numbers below
  const shorter = [label, label.replace(/, \w+ is better\)$/, ")"), label.replace(/ \([^(]*\)$/, "")];
  return shorter.find((text) => pen.measureText(text).width <= room) ?? shorter[2]!;
}

/** A chart in an element of the page, as wide as it. It is rebuilt when its options change. */
export class Chart {
  readonly place: HTMLElement;
  private plot: uPlot | null = null;
  private key = "";

  constructor(id = "") {
    this.place = make("div", id ? { id, class: "chart" } : { class: "chart" });
    new ResizeObserver(() => this.resize()).observe(this.place);
  }

  /** Draw data; `make` gives the options, and is called only if `key` has changed. */
  draw(key: string, data: uPlot.AlignedData, make: () => uPlot.Options): void {
    if (this.plot && key === this.key) {
      this.plot.setData(data);
      return;
    }
    this.clear();
    this.key = key;
    this.plot = new uPlot(make(), data, this.place);
    this.resize();
  }

  /** Show a text in place of the chart. */
  say(text: string): void {
    if (this.key === `say ${text}`) return;
    this.clear();
    this.key = `say ${text}`;
    this.place.append(make("p", { class: "faint" }, text));
  }

  private clear(): void {
    this.plot?.destroy();
    this.plot = null;
    this.place.replaceChildren();
  }

  private resize(): void {
    const width = Math.floor(this.place.clientWidth);
    if (this.plot && width > 0 && width !== this.plot.width) {
      this.plot.setSize({ width, height: this.plot.height });
    }
  }
}
