// Rocks and objects: they fade when detected or taken away, and leave a faint mark.

import type { Channel } from "./data";
import { GONE_OPACITY, LEAST_THING, RING_FRAMES, RING_GROWTH, type Things } from "./playback";
import type { View } from "./view";

type Pen = CanvasRenderingContext2D;

/** Things sorted by how they are drawn, found once: there may be thousands. */
export class Heap {
  private readonly byKind: number[][];
  /** [K] x and y of things that never move. */
  private readonly still: [Float64Array, Float64Array] | null;
  private readonly gone: Float64Array | null;

  constructor(readonly things: Things) {
    const K = things.kind.shape[0]!;
    this.byKind = things.kinds.map(() => []);
    for (let k = 0; k < K; k++) this.byKind[things.kind.at(k)]!.push(k);
    const all = (channel: Channel) => Float64Array.from({ length: K }, (_, k) => channel.at(k));
    const isStill = things.x.shape.length === 1 && things.y.shape.length === 1;
    this.still = isStill ? [all(things.x), all(things.y)] : null;
    this.gone = things.gone && all(things.gone);
  }

  x(t: number, k: number): number {
    return this.still ? this.still[0][k]! : this.things.x.of(t, k);
  }

  y(t: number, k: number): number {
    return this.still ? this.still[1][k]! : this.things.y.of(t, k);
  }

  draw(pen: Pen, view: View, t: number): void {
    const { kinds, state, fade } = this.things;
    const size = Math.max(this.things.size * view.scale, LEAST_THING);
    const fading: number[] = [];
    kinds.forEach((kind, index) => {
      pen.fillStyle = kind.colour;
      const marks: number[] = [];
      // One path for each colour: a fill of many small shapes costs little more than that of one.
      pen.beginPath();
      for (const k of this.byKind[index]!) {
        const age = this.gone ? t - this.gone[k]! : -1;
        if (age < 0) this.outline(pen, view, t, k, size);
        else if (age < Math.max(fade, RING_FRAMES)) fading.push(k);
        else marks.push(k);
      }
      pen.fill();
      pen.globalAlpha = GONE_OPACITY;
      pen.beginPath();
      for (const k of marks) this.outline(pen, view, t, k, size);
      pen.fill();
      pen.globalAlpha = 1;
    });
    if (state) this.drawRims(pen, view, t, size);
    for (const k of fading) this.drawFading(pen, view, t, k, size);
  }

  private outline(pen: Pen, view: View, t: number, k: number, size: number): void {
    const [x, y] = [view.x(this.x(t, k)), view.y(this.y(t, k))];
    if (this.things.shape === "square") pen.rect(x - size, y - size, 2 * size, 2 * size);
    else {
      pen.moveTo(x + size, y);
      pen.arc(x, y, size, 0, 2 * Math.PI);
    }
  }

  private drawFading(pen: Pen, view: View, t: number, k: number, size: number): void {
    const age = t - this.gone![k]!;
    const colour = this.things.kinds[this.things.kind.at(k)]!.colour;
    pen.globalAlpha = 1 - (1 - GONE_OPACITY) * Math.min(age / Math.max(this.things.fade, 1), 1);
    pen.fillStyle = colour;
    pen.beginPath();
    this.outline(pen, view, t, k, size);
    pen.fill();
    if (age < RING_FRAMES) {
      const part = (age + 1) / RING_FRAMES;
      pen.globalAlpha = 1 - part;
      pen.strokeStyle = colour;
      pen.lineWidth = 1.5;
      pen.beginPath();
      pen.arc(
        view.x(this.x(t, k)),
        view.y(this.y(t, k)),
        size + RING_GROWTH * part,
        0,
        2 * Math.PI,
      );
      pen.stroke();
    }
    pen.globalAlpha = 1;
  }

  private drawRims(pen: Pen, view: View, t: number, size: number): void {
    const { state, states } = this.things;
    states.forEach((kind, index) => {
      if (!kind.colour) return;
      pen.strokeStyle = kind.colour;
      pen.lineWidth = 1.5;
      pen.beginPath();
      for (const members of this.byKind) {
        for (const k of members) {
          const isGone = this.gone && t >= this.gone[k]!;
          if (!isGone && state!.at(t, k) === index) this.outline(pen, view, t, k, size + 0.5);
        }
      }
      pen.stroke();
    });
  }
}
