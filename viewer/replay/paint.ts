// Colours of robots, and the few that the page itself uses.

import { FAINT, HUES, type Playback } from "./playback";
import type { State } from "./state";

/** Return a colour for the k-th of some things without one. */
export const hue = (k: number): string => HUES[k % HUES.length]!;

/** Return the colour of a body: that of its kind, or of the robot's action or caste. */
export function colourOf(
  playback: Playback,
  body: number,
  t: number,
  by: State["colourBy"],
): string {
  const robot = playback.robots[body];
  if (!robot) return playback.body_kinds[playback.body[body]!]!.colour || FAINT;
  if (by === "caste") return playback.castes[robot.caste]!.colour || FAINT;
  return playback.actions[playback.action.at(t, body)]?.colour || FAINT;
}

/** A canvas as sharp as the screen, drawn in CSS pixels. */
export class Sheet {
  readonly pen: CanvasRenderingContext2D;
  width = 0;
  height = 0;

  constructor(
    readonly canvas: HTMLCanvasElement,
    hasTransparency = true,
  ) {
    this.pen = canvas.getContext("2d", { alpha: hasTransparency })!;
  }

  /** Set the size in CSS pixels; this erases the canvas. */
  resize(width: number, height: number): void {
    const sharpness = Math.min(window.devicePixelRatio || 1, 2);
    [this.width, this.height] = [width, height];
    this.canvas.width = Math.max(Math.round(width * sharpness), 1);
    this.canvas.height = Math.max(Math.round(height * sharpness), 1);
    this.pen.setTransform(sharpness, 0, 0, sharpness, 0, 0);
  }

  clear(): void {
    this.pen.clearRect(0, 0, this.width, this.height);
  }
}
