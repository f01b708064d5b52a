// Robots and what else moves by itself: trails, bodies, what they hold, which one is selected.

import { colourOf, INK } from "./paint";
import type { Stage } from "./stage";
import type { State } from "./state";
import type { Heap } from "./things";
import type { View } from "./view";

type Pen = CanvasRenderingContext2D;

/** Positions that a trail shows, and pieces of it that fade one after the other. */
const TRAIL = 120;
const PIECES = 4;
/** Radius of the smallest body drawn, in pixels. */
const LEAST = 3.5;

/** Return a body's radius in pixels. */
export function radiusOf(stage: Stage, view: View, body: number): number {
  return Math.max(stage.body_kinds[stage.body[body]!]!.radius * view.scale, LEAST);
}

/** Draw where the robots were in the iterations before. */
export function drawTrails(pen: Pen, stage: Stage, view: View, state: State): void {
  const { t, colourBy } = state;
  const [x0, , x1] = stage.bounds as [number, number, number, number];
  const byColour = new Map<string, number[]>();
  stage.robots.forEach((_, robot) => {
    const colour = colourOf(stage, robot, t, colourBy);
    byColour.set(colour, [...(byColour.get(colour) ?? []), robot]);
  });
  // Lines of one pixel took 0.4 ms for 30 robots, those of 1.2 pixels 2.8 ms.
  pen.lineWidth = 1;
  for (const [colour, robots] of byColour) {
    pen.strokeStyle = colour;
    for (let piece = 0; piece < PIECES; piece++) {
      const from = Math.max(t - (TRAIL * (piece + 1)) / PIECES, 0);
      const to = t - (TRAIL * piece) / PIECES;
      if (to <= 0) break;
      pen.globalAlpha = 0.5 * (1 - piece / PIECES);
      pen.beginPath();
      for (const robot of robots) {
        let last = Infinity;
        for (let s = from; s <= to; s++) {
          const x = stage.x.at(s, robot);
          // Who leaves a world on one side and enters on the other draws no line across it.
          const isJump = Math.abs(x - last) > (x1 - x0) / 2;
          if (isJump) pen.moveTo(view.x(x), view.y(stage.y.at(s, robot)));
          else pen.lineTo(view.x(x), view.y(stage.y.at(s, robot)));
          last = x;
        }
      }
      pen.stroke();
    }
  }
  pen.globalAlpha = 1;
}

/** Draw all bodies, robots last: they are what is looked at. */
export function drawBodies(pen: Pen, stage: Stage, view: View, state: State): void {
  for (let body = stage.body.length - 1; body >= 0; body--) {
    const { t } = state;
    const [x, y] = [view.x(stage.x.at(t, body)), view.y(stage.y.at(t, body))];
    const radius = radiusOf(stage, view, body);
    const isSquare = stage.body_kinds[stage.body[body]!]!.shape === "square";
    pen.beginPath();
    if (isSquare) {
      const corner = 1.25 * radius;
      pen.moveTo(x, y - corner);
      pen.lineTo(x + corner, y);
      pen.lineTo(x, y + corner);
      pen.lineTo(x - corner, y);
      pen.closePath();
    } else pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fillStyle = colourOf(stage, body, t, state.colourBy);
    pen.fill();
    pen.strokeStyle = INK;
    pen.lineWidth = 1;
    pen.stroke();
    if (stage.heading && body < stage.heading.shape[1]!) {
      const angle = stage.heading.at(t, body);
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + radius * Math.cos(angle), y - radius * Math.sin(angle));
      pen.stroke();
    }
  }
}

/** Draw a line from each robot to what it holds. */
export function drawHeld(
  pen: Pen,
  stage: Stage,
  view: View,
  heap: Heap | undefined,
  t: number,
): void {
  if (!stage.held || !heap) return;
  pen.strokeStyle = INK;
  pen.lineWidth = 1;
  pen.beginPath();
  stage.robots.forEach((_, robot) => {
    const k = stage.held!.at(t, robot);
    if (k < 0) return;
    pen.moveTo(view.x(stage.x.at(t, robot)), view.y(stage.y.at(t, robot)));
    pen.lineTo(view.x(heap.x(t, k)), view.y(heap.y(t, k)));
  });
  pen.stroke();
}

/** Draw a robot's number and a ring around it; a thinner one for the robot below the pointer. */
export function drawMark(
  pen: Pen,
  stage: Stage,
  view: View,
  t: number,
  body: number,
  isSelected: boolean,
): void {
  const [x, y] = [view.x(stage.x.at(t, body)), view.y(stage.y.at(t, body))];
  const radius = radiusOf(stage, view, body) + 4;
  pen.strokeStyle = INK;
  pen.lineWidth = isSelected ? 2 : 1;
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
  pen.stroke();
  if (!isSelected) return;
  pen.font = "600 12px system-ui, sans-serif";
  pen.textAlign = "left";
  pen.textBaseline = "bottom";
  // A light rim keeps the number readable on any ground.
  pen.strokeStyle = "#ffffff";
  pen.lineWidth = 3;
  pen.strokeText(String(body), x + radius, y - radius + 4);
  pen.fillStyle = INK;
  pen.fillText(String(body), x + radius, y - radius + 4);
}
