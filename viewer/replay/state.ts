// The reader's choices, and the listeners to their changes.

import { type Playback, SPEED } from "./playback";
import { type Look, wholeOf } from "./view";

/** Iterations per second that can be chosen. */
export const SPEEDS = [5, 15, 30, 60, 120, 240, 480, 960];

export interface State {
  /** The frame that is shown, 0 to T - 1. */
  readonly t: number;
  readonly playing: boolean;
  readonly speed: number;
  readonly colourBy: "action" | "caste";
  /** How the rows of the timeline are sorted. */
  readonly order: "number" | "caste";
  readonly trails: boolean;
  readonly ranges: boolean;
  /** The visible part of the world, the same for all teams. */
  readonly look: Look;
  readonly selected: { readonly team: number; readonly robot: number } | null;
}

type Listener = (now: State, before: State) => void;

/** The state of the page. Listeners are called once per animation frame, for any number of changes. */
export class Store {
  now: State;
  private last: State;
  private readonly listeners: Listener[] = [];
  private asked = 0;

  constructor(readonly playbacks: readonly Playback[]) {
    this.now = this.last = {
      t: 0,
      playing: false,
      speed: SPEED,
      colourBy: "action",
      order: "number",
      trails: true,
      ranges: false,
      look: this.whole,
      selected: null,
    };
  }

  /** The view of the whole world. */
  get whole(): Look {
    return wholeOf(this.playbacks[0]!.bounds);
  }

  /** The number of iterations. */
  get length(): number {
    return this.playbacks[0]!.iterations;
  }

  listen(listener: Listener): void {
    this.listeners.push(listener);
  }

  /** Listen as often as a reader can follow numbers: ten times a second while playing. */
  listenSlowly(listener: (now: State) => void): void {
    let last = -Infinity;
    this.listen((now) => {
      const time = performance.now();
      if (now.playing && time - last < 100) return;
      last = time;
      listener(now);
    });
  }

  /** Change something; values are clipped to their range. */
  set(change: Partial<State>): void {
    const next = { ...this.now, ...change };
    const t = Math.min(Math.max(Math.floor(next.t) || 0, 0), this.length - 1);
    const { selected } = next;
    const isThere = selected && this.playbacks[selected.team]?.robots[selected.robot];
    let { look } = next;
    if (look !== this.now.look) look = look.zoom > 1 ? this.within(look) : this.whole;
    this.now = { ...next, t, look, selected: isThere ? selected : null };
    this.asked ||= requestAnimationFrame(() => this.notify());
  }

  /** Return a view that does not leave the world. */
  private within(look: Look): Look {
    const [x0, y0, x1, y1] = this.playbacks[0]!.bounds;
    const keep = (value: number, low: number, high: number) => {
      const half = (high - low) / (2 * look.zoom);
      return Math.min(Math.max(value, low + half), high - half);
    };
    return { zoom: look.zoom, x: keep(look.x, x0, x1), y: keep(look.y, y0, y1) };
  }

  /** Call all listeners now. */
  notify(): void {
    cancelAnimationFrame(this.asked);
    this.asked = 0;
    const [now, before] = [this.now, this.last];
    this.last = now;
    for (const listener of this.listeners) listener(now, before);
  }
}
