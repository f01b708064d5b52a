// The ranges of robots: rings around them, and the sensor values of a selected one.

import { colourOf, hue } from "./paint";
import { FAINT, INK, type Ring, type Playback, RANGE_FILL, RANGE_LINE } from "./playback";
import type { State } from "./state";
import type { View } from "./view";

type Pen = CanvasRenderingContext2D;

/** Opacity of a wedge whose sensor reads 1; objects below it stay visible. */
const FULL = 0.55;

/** Draw the visible ranges around the robots of one team. */
export function drawRings(
  pen: Pen,
  playback: Playback,
  view: View,
  state: State,
  selected: number,
): void {
  const { t, ranges } = state;
  const [R, B] = [playback.robots.length, playback.body.length];
  for (const ring of playback.rings) {
    const [first, last] = ring.of === "robots" ? [0, R] : [R, B];
    for (let b = first; b < last; b++) {
      if (ring.when === "action") drawAction(pen, playback, view, ring, t, b);
      else if (ranges || b === selected)
        drawOutline(pen, playback, view, ring, t, b, b === selected);
    }
  }
}

/** Return a ring's radius in pixels around a body; bodies that are not of the team have no actions. */
function radius(playback: Playback, view: View, ring: Ring, t: number, b: number): number {
  const action = b < playback.robots.length ? playback.action.at(t, b) : 0;
  return action < 0 ? 0 : (ring.radius[action] ?? 0) * view.scale;
}

function drawAction(
  pen: Pen,
  playback: Playback,
  view: View,
  ring: Ring,
  t: number,
  b: number,
): void {
  const size = radius(playback, view, ring, t, b);
  if (size <= 0) return;
  const colour = colourOf(playback, b, t, "action");
  pen.beginPath();
  pen.arc(view.x(playback.x.at(t, b)), view.y(playback.y.at(t, b)), size, 0, 2 * Math.PI);
  pen.globalAlpha = RANGE_FILL;
  pen.fillStyle = colour;
  pen.fill();
  pen.globalAlpha = RANGE_LINE;
  pen.strokeStyle = colour;
  pen.lineWidth = 1;
  pen.stroke();
  pen.globalAlpha = 1;
}

function drawOutline(
  pen: Pen,
  playback: Playback,
  view: View,
  ring: Ring,
  t: number,
  b: number,
  isSelected: boolean,
): void {
  const size = radius(playback, view, ring, t, b);
  if (size <= 0) return;
  pen.strokeStyle = isSelected ? INK : FAINT;
  pen.globalAlpha = 0.6;
  pen.lineWidth = 1;
  pen.setLineDash(isSelected ? [4, 3] : [2, 3]);
  pen.beginPath();
  pen.arc(view.x(playback.x.at(t, b)), view.y(playback.y.at(t, b)), size, 0, 2 * Math.PI);
  pen.stroke();
  pen.setLineDash([]);
  pen.globalAlpha = 1;
}

/** Draw the directions of a robot's sensors, each wedge as opaque as its sensor's value. */
export function drawWedges(
  pen: Pen,
  playback: Playback,
  view: View,
  t: number,
  robot: number,
): void {
  if (!playback.sensors) return;
  const [x, y] = [view.x(playback.x.at(t, robot)), view.y(playback.y.at(t, robot))];
  const heading = playback.heading?.at(t, robot) ?? 0;
  playback.sensor_groups.forEach((group, index) => {
    const reach = group.reach * view.scale;
    group.angles.forEach((angle, k) => {
      const reading = Math.min(Math.max(playback.sensors!.at(t, robot, group.first + k), 0), 1);
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
