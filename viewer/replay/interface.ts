// Functions for tests, and for readers at the console: window.conevo.

import type { Clock } from "./clock";
import { colourOf } from "./paint";
import type { State, Store } from "./state";
import type { Team } from "./team";

/** Return the functions of window.conevo; ``ready`` is kept when the page is drawn. */
export function makeInterface(store: Store, clock: Clock, teams: readonly Team[]) {
  // Drawing is deferred: read a pixel only after it is done.
  const probe = new OffscreenCanvas(1, 1).getContext("2d", { willReadFrequently: true })!;
  const settle = () => {
    for (const { world } of teams) probe.drawImage(world.canvas, 0, 0);
    probe.getImageData(0, 0, 1, 1);
  };
  return {
    /** Return the state of the page. */
    state(): State & { teams: number } {
      return { ...store.now, teams: teams.length };
    },
    seek(t: number): void {
      store.set({ t });
      store.notify();
    },
    play(): void {
      if (!store.now.playing) clock.toggle();
      store.notify();
    },
    pause(): void {
      store.set({ playing: false });
      store.notify();
    },
    select(team: number, robot: number): void {
      store.set({ selected: { team, robot } });
      store.notify();
    },
    /** Return where a body is now, in pixels of the window. */
    place(team: number, body: number): { x: number; y: number } {
      return teams[team]!.world.place(body);
    },
    /** Return where an iteration is in a robot's row, in pixels of the window. */
    row(team: number, robot: number, t: number): { x: number; y: number } {
      return teams[team]!.timeline.place(robot, t);
    },
    /** Return the colour that a body is drawn in now. */
    colour(team: number, body: number): string {
      return colourOf(store.playbacks[team]!, body, store.now.t, store.now.colourBy);
    },
    /** Return the number of frames drawn while playing since the last call, and the time taken. */
    frames(): { count: number; seconds: number } {
      return clock.frames();
    },
    /** Return the median time of n drawings of everything, in ms. */
    drawMilliseconds(n: number): number {
      const times = Array.from({ length: Math.max(n, 1) }, () => {
        const start = performance.now();
        store.notify();
        settle();
        return performance.now() - start;
      });
      return times.sort((a, b) => a - b)[times.length >> 1]!;
    },
  };
}
