// A list of events: filtered by kind, and a click jumps to one.

import { make, named, say, swatch } from "../shared/dom";
import { INK, type Event, type Playback } from "./playback";
import type { Store } from "./state";

/** Events that are listed at once; all are on the timeline and can be reached with "," and ".". */
const MOST = 1500;

export class Events {
  readonly element: HTMLElement;
  private readonly list: HTMLElement;
  private readonly note = make("p", { class: "note", role: "status" });
  /** Numbers of all events in order of time. */
  private readonly sorted: number[];
  private readonly hidden = new Set<number>();
  private shown: { t: number; button: HTMLElement }[] = [];
  private current: HTMLElement | null = null;

  constructor(
    private readonly playback: Playback,
    team: number,
    private readonly store: Store,
  ) {
    this.sorted = playback.events.map((_, k) => k);
    this.sorted.sort((a, b) => playback.events[a]!.t - playback.events[b]!.t || a - b);
    this.list = make("div", { id: `events-${team}`, class: "events", role: "group" });
    this.list.setAttribute("aria-label", "events in order of time");
    this.element = make("section", { class: "card of-events" }, make("h3", {}, "Events"));
    const filters = make("div", { class: "filters" });
    playback.event_kinds.forEach((_, kind) => filters.append(this.filter(kind)));
    this.element.append(filters, this.list, this.note);
    this.fill();
    store.listen(({ t, playing }) => this.follow(t, playing));
  }

  /** Return the iterations of the listed events, in order. */
  get times(): number[] {
    return this.sorted
      .map((k) => this.playback.events[k]!)
      .filter((one) => this.isWanted(one))
      .map(({ t }) => t);
  }

  private isWanted(event: Event): boolean {
    return !this.hidden.has(event.kind);
  }

  private filter(kind: number): HTMLElement {
    const { name, colour } = this.playback.event_kinds[kind]!;
    const n = this.playback.events.filter((event) => event.kind === kind).length;
    const box = make("input", { type: "checkbox", checked: true, "data-kind": kind });
    box.addEventListener("change", () => {
      if (box.checked) this.hidden.delete(kind);
      else this.hidden.add(kind);
      this.fill();
    });
    return make("label", {}, box, swatch(colour || INK), named(name), `(${n})`);
  }

  private fill(): void {
    const wanted = this.sorted.filter((k) => this.isWanted(this.playback.events[k]!));
    this.shown = wanted.slice(0, MOST).map((k) => {
      const event = this.playback.events[k]!;
      return { t: event.t, button: this.button(event, k) };
    });
    this.list.replaceChildren(...this.shown.map(({ button }) => button));
    const all = this.playback.events.length;
    if (!all) say(this.note, "This epoch has no events.");
    else if (wanted.length > MOST) say(this.note, `The first ${MOST} of ${wanted.length}.`);
    else say(this.note, wanted.length < all ? `${wanted.length} of ${all}.` : "");
    this.current = null;
    this.follow(this.store.now.t, true);
  }

  private button(event: Event, k: number): HTMLElement {
    const button = make("button", {
      type: "button",
      "data-event": k,
      "data-t": event.t,
      title: event.text,
    });
    const { colour } = this.playback.event_kinds[event.kind]!;
    button.append(
      make("b", {}, String(event.t)),
      swatch(colour || INK),
      make("span", {}, event.text),
    );
    button.addEventListener("click", () => this.store.set({ t: event.t }));
    return button;
  }

  /** Mark the last event; while playing it is kept in sight. */
  private follow(t: number, playing: boolean): void {
    let [low, high] = [0, this.shown.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.shown[middle]!.t <= t) low = middle + 1;
      else high = middle;
    }
    const current = this.shown[low - 1]?.button ?? null;
    if (current === this.current) return;
    this.current?.removeAttribute("aria-current");
    current?.setAttribute("aria-current", "true");
    this.current = current;
    // The list must not move while the reader uses it.
    if (!current || !playing || this.list.matches(":hover, :focus-within")) return;
    this.list.scrollTop = current.offsetTop - this.list.clientHeight / 2;
  }
}
