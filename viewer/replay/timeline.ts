// Every robot's actions over the whole epoch: a row for each, specialists are calm and others busy.

import { make, swatch } from "../shared/dom";
import { Sheet } from "./paint";
import { FAINT, type Playback } from "./playback";
import type { State, Store } from "./state";
import type { Tooltip } from "./tooltip";

/** Pixels at the foot of a row that show how often the robot switches there, if there is room. */
const SWITCHES = 2;

export class Timeline {
  readonly canvas: HTMLCanvasElement;
  readonly left = make("div", { class: "rows left", "aria-hidden": "true" });
  readonly right = make("div", { class: "rows right", "aria-hidden": "true" });
  private readonly sheet: Sheet;
  /** Robots from the first row to the last. */
  private rows: number[] = [];

  constructor(
    private readonly playback: Playback,
    private readonly team: number,
    private readonly store: Store,
    private readonly tooltip: Tooltip,
  ) {
    this.canvas = make("canvas", { id: `timeline-${team}`, role: "img", class: "timeline" });
    this.canvas.setAttribute("aria-label", this.summary());
    this.sheet = new Sheet(this.canvas, false);
    this.sort(store.now);
    this.canvas.addEventListener("pointerdown", (event) => this.press(event));
    this.canvas.addEventListener("pointermove", (event) => this.move(event));
    this.canvas.addEventListener("pointerleave", () => this.tooltip.hide());
    store.listen((now, before) => {
      if (now.order !== before.order) this.sort(now);
      if (now.order !== before.order || now.selected !== before.selected) this.mark(now);
      if (now.order !== before.order) this.draw();
    });
  }

  /** Return where a robot's row is at an iteration, in pixels of the browser's window. */
  place(robot: number, t: number): { x: number; y: number } {
    const box = this.canvas.getBoundingClientRect();
    const row = (this.rows.indexOf(robot) + 0.5) / this.rows.length;
    const x = box.left + (box.width * (t + 0.5)) / this.playback.iterations;
    return { x, y: box.top + box.height * row };
  }

  resize(width: number, height: number): void {
    this.sheet.resize(width, height);
    const rowHeight = height / this.rows.length;
    for (const side of [this.left, this.right]) {
      side.style.height = `${height}px`;
      side.style.setProperty("--row", `${rowHeight}px`);
      // Smaller letters would be illegible.
      side.classList.toggle("tight", rowHeight < 8.5);
    }
    this.draw();
  }

  /** Draw all rows, pixel by pixel: a column shows shares of its iterations. */
  private draw(): void {
    const { canvas, pen } = this.sheet;
    const { width, height } = canvas;
    const { playback, rows } = this;
    if (!this.sheet.width || !this.sheet.height) return;
    const image = pen.createImageData(width, height);
    const pixels = new Uint32Array(image.data.buffer);
    const colours = [...playback.actions.map((kind) => kind.colour || FAINT), FAINT].map(abgr);
    const white = abgr("#ffffff");
    pixels.fill(white);
    const counts = new Uint32Array(colours.length);
    rows.forEach((robot, row) => {
      const top = Math.round((row * height) / rows.length);
      const bottom = Math.round(((row + 1) * height) / rows.length);
      const room = bottom - top;
      const foot = room >= 7 ? SWITCHES : 0;
      const body = Math.max(room - (room >= 4 ? 1 : 0) - foot, 1);
      for (let x = 0; x < width; x++) {
        const from = Math.floor((x * playback.iterations) / width);
        const to = Math.max(Math.floor(((x + 1) * playback.iterations) / width), from + 1);
        counts.fill(0);
        let switches = 0;
        for (let t = from; t < to; t++) {
          const action = playback.action.at(t, robot);
          counts[action < 0 ? colours.length - 1 : action]! += 1;
          if (t > 0 && playback.action.at(t - 1, robot) !== action) switches += 1;
        }
        let done = 0;
        for (let action = 0, y = 0; action < colours.length; action++) {
          done += counts[action]!;
          for (const end = Math.round((body * done) / (to - from)); y < end; y++) {
            pixels[(top + y) * width + x] = colours[action]!;
          }
        }
        const grey = Math.round(235 - (200 * switches) / (to - from));
        for (let y = body; y < body + foot; y++) {
          pixels[(top + y) * width + x] = (0xff000000 | (grey << 16) | (grey << 8) | grey) >>> 0;
        }
      }
    });
    pen.putImageData(image, 0, 0);
  }

  private sort(state: State): void {
    const { robots } = this.playback;
    this.rows = robots.map((_, robot) => robot);
    if (state.order === "caste") {
      const rank = (robot: number) => robots[robot]!.caste;
      const calm = (robot: number) => robots[robot]!.specialization;
      this.rows.sort((a, b) => rank(a) - rank(b) || calm(a) - calm(b) || a - b);
    }
    this.left.replaceChildren(
      ...this.rows.map((robot) => make("span", { "data-row": robot }, String(robot))),
    );
    this.right.replaceChildren(...this.rows.map((robot) => this.ending(robot)));
    for (const side of [this.left, this.right]) {
      for (const child of side.children) {
        const robot = Number((child as HTMLElement).dataset["row"]);
        const selected = { team: this.team, robot };
        child.addEventListener("click", () => this.store.set({ selected }));
      }
    }
  }

  /** Return the text at the end of a row: S, the caste, and the share of the favourite setting. */
  private ending(robot: number): HTMLElement {
    const { caste, specialization: s, favourite, share } = this.playback.robots[robot]!;
    const kind = this.playback.castes[caste]!;
    const bar = make("i", { class: "bar" });
    bar.style.setProperty("--part", String(Math.min(Math.max(s, 0), 1)));
    const row = make("span", { "data-row": robot }, bar);
    row.append(make("b", {}, s.toFixed(2)), swatch(kind.colour), make("em", {}, kind.name));
    const colour = this.playback.castes.find((one) => one.name === favourite)?.colour;
    const part = make("i", { class: "bar" });
    part.style.setProperty("--part", String(Math.min(share, 1)));
    part.style.setProperty("--colour", colour || FAINT);
    row.append(part);
    const liked = favourite && `; favourite setting ${favourite}, share ${share.toFixed(3)}`;
    row.title = `robot ${robot}: S = ${s.toFixed(3)}, ${kind.name}${liked}`;
    return row;
  }

  private mark({ selected }: State): void {
    const robot = selected?.team === this.team ? String(selected.robot) : "";
    for (const side of [this.left, this.right]) {
      for (const child of side.children) {
        child.classList.toggle("selected", (child as HTMLElement).dataset["row"] === robot);
      }
    }
  }

  private at(event: MouseEvent): { t: number; robot: number } {
    const box = this.canvas.getBoundingClientRect();
    const part = (event.clientX - box.left) / box.width;
    const row = Math.floor(((event.clientY - box.top) / box.height) * this.rows.length);
    const T = this.playback.iterations;
    const t = Math.min(Math.max(Math.floor(part * T), 0), T - 1);
    return { t, robot: this.rows[Math.min(Math.max(row, 0), this.rows.length - 1)]! };
  }

  private press(event: PointerEvent): void {
    if (event.button) return;
    const { t, robot } = this.at(event);
    this.canvas.setPointerCapture(event.pointerId);
    this.store.set({ t, selected: { team: this.team, robot } });
  }

  private move(event: PointerEvent): void {
    const { t, robot } = this.at(event);
    if (event.buttons & 1) this.store.set({ t });
    const action = this.playback.actions[this.playback.action.at(t, robot)]?.name ?? "no action";
    const text = `robot ${robot}, iteration ${t}: ${action}`;
    this.tooltip.show(event.clientX, event.clientY, text);
  }

  /** Return a description in words. */
  private summary(): string {
    const { robots, actions, castes } = this.playback;
    const names = castes.map((kind, index) => {
      const n = robots.filter((one) => one.caste === index).length;
      return `${n} ${kind.name}`;
    });
    const of = `Actions (${actions.map((kind) => kind.name).join(", ")})`;
    const extent = `${robots.length} robots over ${this.playback.iterations} iterations`;
    return `${of} of ${extent}: ${names.join(", ")}`;
  }
}

/** Return "#rrggbb" as a number whose bytes in memory are red, green, blue, opaque. */
function abgr(colour: string): number {
  const rgb = parseInt(colour.slice(1), 16);
  return (0xff000000 | ((rgb & 255) << 16) | (rgb & 0xff00) | (rgb >> 16)) >>> 0;
}
