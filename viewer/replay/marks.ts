// Below the rows of a timeline: events, a lane for each kind, and curves of measures.

import { make, say, swatch } from "../shared/dom";
import { Sheet } from "./paint";
import { FAINT, INK, type Event, type Curve, type Playback } from "./playback";
import type { Store } from "./state";
import type { Tooltip } from "./tooltip";

/** Heights in CSS pixels. */
const LANE = 13;
const CURVE = 26;
/** Pixels around a mark that still belong to it. */
const REACH = 4;

export class Marks {
  readonly canvas: HTMLCanvasElement;
  readonly right = make("div", { class: "lanes", "aria-hidden": "true" });
  readonly height: number;
  private readonly sheet: Sheet;
  private readonly values: HTMLElement[] = [];
  private readonly extents: [number, number][];
  /** Kinds of the events that happened, one for each lane. */
  private readonly lanes: number[];

  constructor(
    private readonly playback: Playback,
    team: number,
    private readonly store: Store,
    private readonly tooltip: Tooltip,
  ) {
    const label = "Events and measures over time";
    this.canvas = make("canvas", { id: `marks-${team}`, role: "img", "aria-label": label });
    this.sheet = new Sheet(this.canvas, false);
    // Two teams have the same lanes and the same scales: they are compared.
    const happened = new Set(store.playbacks.flatMap((one) => one.events.map(({ kind }) => kind)));
    this.lanes = playback.event_kinds.map((_, kind) => kind).filter((kind) => happened.has(kind));
    this.height = LANE * this.lanes.length + CURVE * playback.measures.length;
    this.extents = playback.measures.map(({ name }) => {
      const same = store.playbacks.flatMap((one) =>
        one.measures.filter((measure) => measure.name === name),
      );
      const ranges = same.map(({ values }) => values.range());
      // The curve of a measure that is never negative starts at zero.
      return [
        Math.min(0, ...ranges.map(([least]) => least)),
        Math.max(...ranges.map(([, most]) => most)),
      ];
    });
    this.describe();
    this.canvas.addEventListener("pointerdown", (event) => this.press(event));
    this.canvas.addEventListener("pointermove", (event) => this.move(event));
    this.canvas.addEventListener("pointerleave", () => this.tooltip.hide());
    store.listenSlowly(({ t }) => this.update(t));
  }

  resize(width: number): void {
    this.sheet.resize(width, this.height);
    const { pen } = this.sheet;
    pen.fillStyle = "#ffffff";
    pen.fillRect(0, 0, width, this.height);
    this.lanes.forEach((kind, lane) => {
      pen.fillStyle = "#f1f0ec";
      pen.fillRect(0, LANE * lane + 2, width, LANE - 4);
      pen.fillStyle = this.playback.event_kinds[kind]!.colour || INK;
      for (const event of this.playback.events) {
        if (event.kind === kind)
          pen.fillRect(this.x(event.t) - 0.75, LANE * lane + 2, 1.5, LANE - 4);
      }
    });
    const top = LANE * this.lanes.length;
    this.playback.measures.forEach((measure, k) => this.drawCurve(measure, k, top + CURVE * k));
  }

  /** Show the values of the measures in a frame. */
  update(t: number): void {
    this.playback.measures.forEach((measure, k) =>
      say(this.values[k]!, short(measure.values.at(t))),
    );
  }

  private describe(): void {
    for (const index of this.lanes) {
      const kind = this.playback.event_kinds[index]!;
      const n = this.playback.events.filter((event) => event.kind === index).length;
      const row = make(
        "span",
        { title: kind.name },
        swatch(kind.colour || INK),
        make("em", {}, kind.name),
      );
      row.append(make("b", {}, String(n)));
      row.style.height = `${LANE}px`;
      this.right.append(row);
    }
    for (const measure of this.playback.measures) {
      const value = make("b");
      this.values.push(value);
      const row = make(
        "span",
        { class: "measure", title: measure.name },
        make("em", {}, measure.name),
        value,
      );
      row.style.height = `${CURVE}px`;
      this.right.append(row);
    }
  }

  private drawCurve({ values }: Curve, k: number, top: number): void {
    const { pen, width } = this.sheet;
    const T = this.playback.iterations;
    const [low, most] = this.extents[k]!;
    const y = (value: number) =>
      top + CURVE - 2 - ((CURVE - 5) * (value - low)) / (most - low || 1);
    pen.beginPath();
    const points = Math.min(Math.ceil(width), T);
    for (let p = 0; p < points; p++) {
      const t = points > 1 ? Math.round((p * (T - 1)) / (points - 1)) : 0;
      pen.lineTo(this.x(t), y(values.at(t)));
    }
    pen.strokeStyle = INK;
    pen.lineWidth = 1.2;
    pen.stroke();
    pen.lineTo(this.x(T - 1), top + CURVE - 2);
    pen.lineTo(this.x(0), top + CURVE - 2);
    pen.globalAlpha = 0.15;
    pen.fillStyle = FAINT;
    pen.fill();
    pen.globalAlpha = 1;
  }

  private x(t: number): number {
    return (this.sheet.width * (t + 0.5)) / this.playback.iterations;
  }

  /** Return the event whose mark is below the pointer, if there is one. */
  private below(event: MouseEvent): Event | null {
    const box = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    const kind = this.lanes[Math.floor(y / LANE)];
    let best: Event | null = null;
    let least = REACH;
    for (const one of this.playback.events) {
      const away = Math.abs(this.x(one.t) - x);
      if (one.kind === kind && away <= least) [best, least] = [one, away];
    }
    return best;
  }

  private at(event: MouseEvent): number {
    const box = this.canvas.getBoundingClientRect();
    const t = Math.floor(((event.clientX - box.left) / box.width) * this.playback.iterations);
    return Math.min(Math.max(t, 0), this.playback.iterations - 1);
  }

  private press(event: PointerEvent): void {
    if (event.button) return;
    this.canvas.setPointerCapture(event.pointerId);
    this.store.set({ t: this.below(event)?.t ?? this.at(event) });
  }

  private move(event: PointerEvent): void {
    if (event.buttons & 1) this.store.set({ t: this.at(event) });
    const found = this.below(event);
    this.canvas.style.cursor = found ? "pointer" : "";
    const t = found?.t ?? this.at(event);
    const measures = this.playback.measures.map((one) => `${one.name} ${short(one.values.at(t))}`);
    const text = [`iteration ${t}`, ...(found ? [found.text] : measures)].join(": ");
    this.tooltip.show(event.clientX, event.clientY, text);
  }
}

/** Return a number with few digits. */
export function short(value: number): string {
  if (Number.isInteger(value)) return String(value);
  return Math.abs(value) >= 100 ? value.toFixed(1) : value.toPrecision(3);
}
