// Robots and other moving bodies: trails, bodies, things they hold, the selected one.

import { colourOf } from "./paint";
import {
  INK,
  JUMP,
  KITE_SIDE,
  KITE_TIP,
  LEAST_BODY,
  type Playback,
  TRAIL,
  TRAIL_OPACITY,
  TRAIL_PIECES,
} from "./playback";
import type { State } from "./state";
import type { Heap } from "./things";
import type { View } from "./view";

type Pen = CanvasRenderingContext2D;

/** Return a body's radius in pixels. */
export function radiusOf(playback: Playback, view: View, body: number): number {
  return Math.max(playback.body_kinds[playback.body[body]!]!.radius * view.scale, LEAST_BODY);
}

/** Draw where the robots were in previous iterations. */
export function drawTrails(pen: Pen, playback: Playback, view: View, state: State): void {
  const { t, colourBy } = state;
  const [x0, y0, x1, y1] = playback.bounds;
  const byColour = new Map<string, number[]>();
  playback.robots.forEach((_, robot) => {
    const colour = colourOf(playback, robot, t, colourBy);
    byColour.set(colour, [...(byColour.get(colour) ?? []), robot]);
  });
  // Lines of one pixel took 0.4 ms for 30 robots, those of 1.2 pixels 2.8 ms.
  pen.lineWidth = 1;
  for (const [colour, robots] of byColour) {
    pen.strokeStyle = colour;
    for (let piece = 0; piece < TRAIL_PIECES; piece++) {
      const from = Math.max(t - (TRAIL * (piece + 1)) / TRAIL_PIECES, 0);
      const to = t - (TRAIL * piece) / TRAIL_PIECES;
      if (to <= 0) break;
      pen.globalAlpha = TRAIL_OPACITY * (1 - piece / TRAIL_PIECES);
      pen.beginPath();
      for (const robot of robots) {
        let last = [Infinity, Infinity] as const;
        for (let s = from; s <= to; s++) {
          const [x, y] = [playback.x.at(s, robot), playback.y.at(s, robot)];
          // A body that leaves a world on one side and enters on the other draws no line across it.
          const isFar = Math.abs(x - last[0]) > JUMP * (x1 - x0);
          if (isFar || Math.abs(y - last[1]) > JUMP * (y1 - y0)) pen.moveTo(view.x(x), view.y(y));
          else pen.lineTo(view.x(x), view.y(y));
          last = [x, y];
        }
      }
      pen.stroke();
    }
  }
  pen.globalAlpha = 1;
}

/** Draw all bodies, robots last, above the others. */
export function drawBodies(pen: Pen, playback: Playback, view: View, state: State): void {
  for (let body = playback.body.length - 1; body >= 0; body--) {
    const { t } = state;
    const [x, y] = [view.x(playback.x.at(t, body)), view.y(playback.y.at(t, body))];
    const radius = radiusOf(playback, view, body);
    const isSquare = playback.body_kinds[playback.body[body]!]!.shape === "square";
    pen.beginPath();
    if (isSquare) {
      // A kite: it points ahead.
      const ahead = playback.heading?.at(t, body) ?? 0;
      for (let k = 0; k < 4; k++) {
        const reach = radius * (k ? KITE_SIDE : KITE_TIP);
        const turn = ahead + (k * Math.PI) / 2;
        pen.lineTo(x + reach * Math.cos(turn), y - reach * Math.sin(turn));
      }
      pen.closePath();
    } else pen.arc(x, y, radius, 0, 2 * Math.PI);
    pen.fillStyle = colourOf(playback, body, t, state.colourBy);
    pen.fill();
    pen.strokeStyle = INK;
    pen.lineWidth = 1;
    pen.stroke();
    if (playback.heading && !isSquare) {
      const angle = playback.heading.at(t, body);
      pen.beginPath();
      pen.moveTo(x, y);
      pen.lineTo(x + radius * Math.cos(angle), y - radius * Math.sin(angle));
      pen.stroke();
    }
  }
}

/** Draw a line from each robot to the thing that it holds. */
export function drawHeld(
  pen: Pen,
  playback: Playback,
  view: View,
  heap: Heap | undefined,
  t: number,
): void {
  if (!playback.held || !heap) return;
  pen.strokeStyle = INK;
  pen.lineWidth = 1;
  pen.beginPath();
  playback.robots.forEach((_, robot) => {
    const k = playback.held!.at(t, robot);
    if (k < 0) return;
    pen.moveTo(view.x(playback.x.at(t, robot)), view.y(playback.y.at(t, robot)));
    pen.lineTo(view.x(heap.x(t, k)), view.y(heap.y(t, k)));
  });
  pen.stroke();
}

/** Draw a robot's number and a ring around it; a thinner one for the robot below the pointer. */
export function drawMark(
  pen: Pen,
  playback: Playback,
  view: View,
  t: number,
  body: number,
  isSelected: boolean,
): void {
  const [x, y] = [view.x(playback.x.at(t, body)), view.y(playback.y.at(t, body))];
  const radius = radiusOf(playback, view, body) + 4;
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
