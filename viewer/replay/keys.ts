// The keyboard, and the page that explains it.

import { find, make } from "../shared/dom";
import type { Clock } from "./clock";
import { SPEEDS, type Store } from "./state";
import { zoom } from "./zoom";

const HELP: [string, string][] = [
  ["Space", "play, pause"],
  ["← →", "one iteration back, forward; ten with Shift"],
  ["Home End", "first, last iteration"],
  [", .", "previous, next event"],
  ["− +", "slower, faster"],
  ["↑ ↓", "previous, next robot"],
  ["Esc", "no robot"],
  ["c", "colours by action or by caste"],
  ["t", "trails"],
  ["r", "ranges of all robots"],
  ["z Z 0", "zoom in, zoom out, whole world; the mouse wheel zooms, too"],
  ["?", "this list"],
];

/** Listen to keys. ``times`` are the iterations of the listed events, in order. */
export function listenToKeys(store: Store, clock: Clock, times: () => number[]): void {
  const help = find("help", HTMLDialogElement);
  find("keys", HTMLElement).append(
    ...HELP.map(([key, what]) => make("div", {}, make("dt", {}, key), make("dd", {}, what))),
  );
  find("open-help", HTMLButtonElement).addEventListener("click", () => help.showModal());
  find("close-help", HTMLButtonElement).addEventListener("click", () => help.close());

  const go = (t: number) => store.set({ t, playing: false });
  const faster = (by: number) => {
    const index = SPEEDS.indexOf(store.now.speed) + by;
    store.set({ speed: SPEEDS[Math.min(Math.max(index, 0), SPEEDS.length - 1)]! });
  };
  const robot = (by: number) => {
    const { selected } = store.now;
    const team = selected?.team ?? 0;
    const n = store.playbacks[team]!.robots.length;
    const next = selected ? selected.robot + by : by > 0 ? 0 : n - 1;
    store.set({ selected: { team, robot: (next + n) % n } });
  };
  const nearer = (factor: number) => {
    const { selected, t, look } = store.now;
    const playback = selected && store.playbacks[selected.team];
    // Around the selected robot, or around the middle of the view.
    const x = playback ? playback.x.at(t, selected.robot) : look.x;
    const y = playback ? playback.y.at(t, selected.robot) : look.y;
    if (playback && factor > 1) store.set({ look: { ...look, x, y } });
    zoom(store, factor, x, y);
  };
  const actions: Record<string, (event: KeyboardEvent) => void> = {
    " ": () => clock.toggle(),
    ArrowLeft: ({ shiftKey }) => go(store.now.t - (shiftKey ? 10 : 1)),
    ArrowRight: ({ shiftKey }) => go(store.now.t + (shiftKey ? 10 : 1)),
    Home: () => go(0),
    End: () => go(store.length - 1),
    ",": () => go(times().findLast((t) => t < store.now.t) ?? store.now.t),
    ".": () => go(times().find((t) => t > store.now.t) ?? store.now.t),
    "-": () => faster(-1),
    "+": () => faster(1),
    "=": () => faster(1),
    ArrowUp: () => robot(-1),
    ArrowDown: () => robot(1),
    Escape: () => store.set({ selected: null }),
    c: () => store.set({ colourBy: store.now.colourBy === "action" ? "caste" : "action" }),
    t: () => store.set({ trails: !store.now.trails }),
    r: () => store.set({ ranges: !store.now.ranges }),
    z: () => nearer(1.5),
    Z: () => nearer(1 / 1.5),
    "0": () => store.set({ look: store.whole }),
    "?": () => help.showModal(),
  };
  document.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || help.open) return;
    const action = actions[event.key];
    if (!action || isOwn(event)) return;
    event.preventDefault();
    action(event);
  });
  releaseFocus();
}

/** Whether a key has another meaning for the control that has the focus. */
function isOwn({ target, key }: KeyboardEvent): boolean {
  if (target instanceof HTMLSelectElement) return key !== "Escape";
  const isPressed = target instanceof HTMLButtonElement || isCheckbox(target);
  return isPressed && key === " ";
}

function isCheckbox(target: EventTarget | null): boolean {
  return target instanceof HTMLInputElement && target.type === "checkbox";
}

/** Give the keys back to the page after a click: the space bar plays, and does not click again.
 *
 * With the keyboard the focus stays.
 */
function releaseFocus(): void {
  let isPointer = false;
  document.addEventListener("pointerdown", () => (isPointer = true), true);
  document.addEventListener("keydown", () => (isPointer = false), true);
  const release = ({ target }: Event) => {
    const isChoice = target instanceof HTMLSelectElement || isCheckbox(target);
    const button = target instanceof Element ? target.closest("button") : null;
    if (isPointer && isChoice) (target as HTMLElement).blur();
    else if (isPointer) button?.blur();
  };
  document.addEventListener("click", (event) => {
    // A select is still open after the click on it.
    if (!(event.target instanceof HTMLSelectElement)) release(event);
  });
  document.addEventListener("change", release);
}
