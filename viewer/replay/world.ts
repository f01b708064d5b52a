// The world of one team on its canvas, in the current frame.

import { drawBodies, drawHeld, drawMark, drawTrails } from "./bodies";
import { drawGround, drawLabels } from "./ground";
import { Sheet } from "./paint";
import { drawRings, drawWedges } from "./ranges";
import type { Playback } from "./playback";
import type { State, Store } from "./state";
import { Heap } from "./things";
import type { Tooltip } from "./tooltip";
import { type Look, nearest, View } from "./view";
import { letZoom } from "./zoom";

export class World {
  readonly view: View;
  private readonly sheet: Sheet;
  /** The ground is drawn once for a size, and copied. */
  private readonly ground = new Sheet(document.createElement("canvas"), false);
  private readonly heaps: Heap[];
  /** The view that the ground was drawn for. */
  private look: Look | null = null;
  /** The body below the pointer, and the frame in which it was there. */
  private hovered = -1;
  private hoveredAt = 0;

  constructor(
    readonly canvas: HTMLCanvasElement,
    private readonly playback: Playback,
    private readonly team: number,
    private readonly store: Store,
    private readonly tooltip: Tooltip,
  ) {
    this.view = new View(playback.bounds);
    this.sheet = new Sheet(canvas, false);
    this.heaps = playback.things.map((things) => new Heap(things));
    letZoom(canvas, this.view, store);
    canvas.addEventListener("click", (event) => this.click(event));
    canvas.addEventListener("pointermove", (event) => this.hover(event));
    canvas.addEventListener("pointerleave", () => this.leave());
  }

  /** Take the canvas' size in the page, in CSS pixels. */
  resize(width: number, height: number): void {
    this.sheet.resize(width, height);
    this.ground.resize(width, height);
    this.look = null;
    this.draw(this.store.now);
  }

  private drawGround(look: Look): void {
    const { pen, width, height } = this.ground;
    this.look = look;
    this.view.fit(width, height, look);
    pen.fillStyle = "#ffffff";
    pen.fillRect(0, 0, width, height);
    drawGround(pen, this.playback, this.view);
  }

  draw(state: State): void {
    const { playback, view } = this;
    const { pen, width, height } = this.sheet;
    if (!width || !height) return;
    if (this.hovered >= 0 && state.t !== this.hoveredAt) {
      this.hovered = -1;
      this.tooltip.hide();
    }
    const selected = state.selected?.team === this.team ? state.selected.robot : -1;
    if (state.look !== this.look) this.drawGround(state.look);
    pen.drawImage(this.ground.canvas, 0, 0, width, height);
    for (const heap of this.heaps) heap.draw(pen, view, state.t);
    drawLabels(pen, playback, view);
    pen.save();
    pen.clip(view.path());
    drawRings(pen, playback, view, state, selected);
    if (selected >= 0) drawWedges(pen, playback, view, state.t, selected);
    pen.restore();
    if (state.trails) drawTrails(pen, playback, view, state);
    drawBodies(pen, playback, view, state);
    drawHeld(pen, playback, view, this.heaps[0], state.t);
    if (this.hovered >= 0 && this.hovered !== selected) {
      drawMark(pen, playback, view, state.t, this.hovered, false);
    }
    if (selected >= 0) drawMark(pen, playback, view, state.t, selected, true);
  }

  /** Return where a body is now, in pixels of the browser's window. */
  place(body: number): { x: number; y: number } {
    const box = this.canvas.getBoundingClientRect();
    const { t } = this.store.now;
    const x = box.left + this.view.x(this.playback.x.at(t, body));
    return { x, y: box.top + this.view.y(this.playback.y.at(t, body)) };
  }

  private below(event: MouseEvent, among: number): number {
    const box = this.canvas.getBoundingClientRect();
    const [x, y] = [event.clientX - box.left, event.clientY - box.top];
    return nearest(this.playback, this.view, this.store.now.t, x, y, among);
  }

  private click(event: MouseEvent): void {
    const robot = this.below(event, this.playback.robots.length);
    this.store.set({ selected: robot < 0 ? null : { team: this.team, robot } });
  }

  private hover(event: PointerEvent): void {
    const body = this.below(event, this.playback.body.length);
    this.canvas.style.cursor = body >= 0 && body < this.playback.robots.length ? "pointer" : "";
    if (body < 0) return this.leave();
    this.tooltip.show(event.clientX, event.clientY, this.words(body));
    if (body !== this.hovered) {
      this.hovered = body;
      this.hoveredAt = this.store.now.t;
      this.draw(this.store.now);
    }
  }

  private words(body: number): string {
    const { playback } = this;
    const robot = playback.robots[body];
    if (!robot) return playback.body_kinds[playback.body[body]!]!.name;
    const action =
      playback.actions[playback.action.at(this.store.now.t, body)]?.name ?? "no action";
    return `robot ${body}: ${action} (${playback.castes[robot.caste]!.name})`;
  }

  private leave(): void {
    this.tooltip.hide();
    if (this.hovered < 0) return;
    this.hovered = -1;
    this.draw(this.store.now);
  }
}
