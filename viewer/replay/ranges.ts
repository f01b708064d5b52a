// How far robots see and reach: rings around them, and what each sensor of one of them reads.

import { colourOf, FAINT, hue, INK } from "./paint";
import type { Ring, Stage } from "./stage";
import type { State } from "./state";
import type { View } from "./view";

type Pen = CanvasRenderingContext2D;

/** How opaque a wedge is whose sensor reads 1: what lies below it can still be seen. */
const FULL = 0.55;

/** Draw the ranges that are to be seen now around the robots of one team. */
export function drawRings(
  pen: Pen,
  stage: Stage,
  view: View,
  state: State,
  selected: number,
): void {
  const { t, ranges } = state;
  const [R, B] = [stage.robots.length, stage.body.length];
  for (const ring of stage.rings) {
    const [first, last] = ring.of === "robots" ? [0, R] : [R, B];
    for (let b = first; b < last; b++) {
      if (ring.when === "action") drawAction(pen, stage, view, ring, t, b);
      else if (ranges || b === selected) drawOutline(pen, stage, view, ring, t, b, b === selected);
    }
  }
}

/** Return a ring's radius in pixels around a body; what is not of the team has no actions. */
function radius(stage: Stage, view: View, ring: Ring, t: number, b: number): number {
  const action = b < stage.robots.length ? stage.action.at(t, b) : 0;
  return action < 0 ? 0 : (ring.radius[action] ?? 0) * view.scale;
}

function drawAction(pen: Pen, stage: Stage, view: View, ring: Ring, t: number, b: number): void {
  const size = radius(stage, view, ring, t, b);
  if (size <= 0) return;
  const colour = colourOf(stage, b, t, "action");
  pen.beginPath();
  pen.arc(view.x(stage.x.at(t, b)), view.y(stage.y.at(t, b)), size, 0, 2 * Math.PI);
  pen.globalAlpha = 0.1;
  pen.fillStyle = colour;
  pen.fill();
  pen.globalAlpha = 0.35;
  pen.strokeStyle = colour;
  pen.lineWidth = 1;
  pen.stroke();
  pen.globalAlpha = 1;
}

function drawOutline(
  pen: Pen,
  stage: Stage,
  view: View,
  ring: Ring,
  t: number,
  b: number,
  isSelected: boolean,
): void {
  const size = radius(stage, view, ring, t, b);
  if (size <= 0) return;
  pen.strokeStyle = isSelected ? INK : FAINT;
  pen.globalAlpha = 0.6;
  pen.lineWidth = 1;
  pen.setLineDash(isSelected ? [4, 3] : [2, 3]);
  pen.beginPath();
  pen.arc(view.x(stage.x.at(t, b)), view.y(stage.y.at(t, b)), size, 0, 2 * Math.PI);
  pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}

/** Draw where a robot's sensors look, each wedge as opaque as its sensor's reading. */
export function drawWedges(pen: Pen, stage: Stage, view: View, t: number, robot: number): void {
  if (!stage.sensors) return;
  const [x, y] = [view.x(stage.x.at(t, robot)), view.y(stage.y.at(t, robot))];
  const heading = stage.heading?.at(t, robot) ?? 0;
  stage.sensor_groups.forEach((group, index) => {
    const reach = group.reach * view.scale;
    group.angles.forEach((angle, k) => {
      const reading = Math.min(Math.max(stage.sensors!.at(t, robot, group.first + k), 0), 1);
      // Angles turn the other way on a canvas, where y points down.
      const middle = -(angle + (group.turns ? heading : 0));
      pen.beginPath();
      pen.moveTo(x, y);
      pen.arc(x, y, reach, middle - group.half, middle + group.half);
      pen.closePath();
      pen.globalAlpha = FULL * reading;
      pen.fillStyle = hue(index);
      pen.fill();
      pen.globalAlpha = 0.25;
      pen.strokeStyle = FAINT;
      pen.lineWidth = 0.5;
      pen.stroke();
    });
  });
  pen.globalAlpha = 1;
}
