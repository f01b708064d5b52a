// From the world's lengths to pixels of a canvas.

import { radiusOf } from "./bodies";
import type { Playback } from "./playback";

/** Pixels around the world, for its border and for names of robots at it. */
const MARGIN = 6;

/** A view: its magnification, 1 for the whole world, and the point in the middle. */
export interface Look {
  readonly zoom: number;
  readonly x: number;
  readonly y: number;
}

/** Return the view of a whole world. */
export function wholeOf(bounds: Playback["bounds"]): Look {
  const [x0, y0, x1, y1] = bounds;
  return { zoom: 1, x: (x0 + x1) / 2, y: (y0 + y1) / 2 };
}

/** The position of a world on its canvas, in CSS pixels. */
export class View {
  /** Pixels per length. */
  scale = 1;
  private left = 0;
  private top = 0;

  constructor(private readonly bounds: Playback["bounds"]) {}

  /** Return width / height of the world. */
  get aspect(): number {
    const [x0, y0, x1, y1] = this.bounds;
    return (x1 - x0) / (y1 - y0);
  }

  /** Center a view on a canvas of a size. */
  fit(width: number, height: number, look: Look): void {
    const [x0, y0, x1, y1] = this.bounds;
    const [across, up] = [width - 2 * MARGIN, height - 2 * MARGIN];
    this.scale = look.zoom * Math.max(Math.min(across / (x1 - x0), up / (y1 - y0)), 1e-9);
    this.left = width / 2 - this.scale * look.x;
    this.top = height / 2 + this.scale * look.y;
  }

  x(x: number): number {
    return this.left + this.scale * x;
  }

  /** y points up in the world and down on a canvas. */
  y(y: number): number {
    return this.top - this.scale * y;
  }

  /** Return the outline of the world. */
  path(): Path2D {
    const [x0, y0, x1, y1] = this.bounds;
    const path = new Path2D();
    path.rect(this.x(x0), this.y(y1), this.scale * (x1 - x0), this.scale * (y1 - y0));
    return path;
  }

  /** Return the point of the world at a point of the canvas. */
  at(x: number, y: number): [number, number] {
    return [(x - this.left) / this.scale, (this.top - y) / this.scale];
  }
}

/** Return the number of the body nearest to a point of the canvas, among the first ``among``.
 *
 * -1 if none is near enough to be meant.
 */
export function nearest(
  playback: Playback,
  view: View,
  t: number,
  x: number,
  y: number,
  among: number,
): number {
  let [best, least] = [-1, Infinity];
  for (let b = 0; b < among; b++) {
    const reach = radiusOf(playback, view, b) + 6;
    const away = Math.hypot(view.x(playback.x.at(t, b)) - x, view.y(playback.y.at(t, b)) - y);
    if (away <= reach && away < least) [best, least] = [b, away];
  }
  return best;
}
