// Playing: time advances by elapsed time x speed, one drawing per animation frame.

import type { Store } from "./state";

export class Clock {
  private position = 0;
  private last = 0;
  private request = 0;
  private readonly drawn = { count: 0, seconds: 0 };

  constructor(private readonly store: Store) {
    store.listen((now, before) => {
      if (now.playing === before.playing) return;
      if (now.playing) this.start();
      else cancelAnimationFrame(this.request);
    });
  }

  /** Play from here, or from the start if the end is reached; or pause. */
  toggle(): void {
    const { playing, t } = this.store.now;
    const isOver = t >= this.store.length - 1;
    this.store.set(playing ? { playing: false } : { playing: true, t: isOver ? 0 : t });
  }

  /** Return the number of frames drawn while playing since the last call, and the time taken. */
  frames(): { count: number; seconds: number } {
    const drawn = { ...this.drawn };
    this.drawn.count = this.drawn.seconds = 0;
    return drawn;
  }

  private start(): void {
    this.last = performance.now();
    this.position = this.store.now.t;
    this.request = requestAnimationFrame((now) => this.frame(now));
  }

  private frame(now: number): void {
    const { t, speed, playing } = this.store.now;
    if (!playing) return;
    // Frames may be dated before the click that started them, and a hidden page gets none at all.
    const seconds = Math.min(Math.max((now - this.last) / 1000, 0), 0.25);
    this.last = now;
    if (t !== Math.floor(this.position)) this.position = t;
    this.position += seconds * speed;
    const end = this.store.length - 1;
    this.store.set({ t: this.position, playing: this.position < end });
    this.store.notify();
    this.drawn.count += 1;
    this.drawn.seconds += seconds;
    if (this.store.now.playing) this.request = requestAnimationFrame((next) => this.frame(next));
  }
}
