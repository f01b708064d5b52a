// The cards next to a world: its key, gauges, plans of objects, and facts about the epoch.

import { make, say, swatch } from "../shared/dom";
import { short } from "./marks";
import { FAINT, INK, type Playback } from "./playback";
import type { Store } from "./state";

/** Return the cards of a playback, without empty ones. */
export function cards(
  playback: Playback,
  store: Store,
): Record<"key" | "gauges" | "plan" | "facts", HTMLElement> {
  return {
    key: card("key", "In the world", key(playback)),
    gauges: card("gauges", "Now", gauges(playback, store)),
    plan: card("plan", "To be built", plan(playback, store)),
    facts: card("facts", "This epoch", facts(playback)),
  };
}

function card(name: string, title: string, content: HTMLElement): HTMLElement {
  const isEmpty = !content.childElementCount;
  return make(
    "section",
    { class: `card of-${name}`, hidden: isEmpty },
    make("h3", {}, title),
    content,
  );
}

/** Other marks in the world than the robots. */
function key(playback: Playback): HTMLElement {
  const list = make("ul", { class: "key" });
  const add = (name: string, fill: string, line: string, shape: string) => {
    const sign = swatch(fill || "transparent");
    sign.classList.add(shape);
    if (line) sign.style.borderColor = line;
    list.append(make("li", {}, sign, name));
  };
  for (const { name, colour, shape } of playback.body_kinds) {
    if (colour) add(name, colour, INK, shape === "square" ? "diamond" : "disc");
  }
  if (playback.action.range()[0] < 0) add("robot without an action", FAINT, INK, "disc");
  for (const { kinds, shape, states } of playback.things) {
    for (const { name, colour } of kinds) add(name, colour, "", shape);
    for (const { name, colour } of states) if (colour) add(name, "", colour, shape);
  }
  for (const { label, fill, line, shape } of playback.backdrop) {
    if (label && fill) add(label, fill, line, shape);
  }
  for (const { name, when } of playback.rings) {
    add(name, when === "action" ? "#e9e9ec" : "", FAINT, when === "action" ? "disc" : "dashed");
  }
  return list;
}

function gauges(playback: Playback, store: Store): HTMLElement {
  const list = make("ul", { class: "values" });
  const rows = playback.gauges.map(({ name, colour }) => {
    const [bar, value] = [make("i", { class: "bar" }), make("b")];
    if (colour) bar.style.setProperty("--colour", colour);
    list.append(make("li", {}, make("span", {}, name), bar, value));
    return { bar, value };
  });
  store.listenSlowly(({ t }) => {
    playback.gauges.forEach(({ values, most }, k) => {
      const now = values.at(t);
      const part = most > 0 ? Math.min(Math.max(now / most, 0), 1) : 0;
      rows[k]!.bar.style.setProperty("--part", part.toFixed(3));
      say(rows[k]!.value, short(now));
    });
  });
  return list;
}

function plan(playback: Playback, store: Store): HTMLElement {
  const kinds = playback.things[0]?.kinds ?? [];
  const list = make("ul", { class: "plan" });
  const parts: { built: number; element: HTMLElement }[] = [];
  const counts: { built: readonly number[]; element: HTMLElement }[] = [];
  for (const row of playback.plan) {
    const line = make("span", { class: "parts" });
    row.parts.forEach((part, k) => {
      const { name, colour } = kinds[part]!;
      const element = make("i", { title: name, role: "img", "aria-label": name });
      element.style.setProperty("--colour", colour);
      parts.push({ built: row.built[k]!, element });
      line.append(element);
    });
    const count = make("b");
    counts.push({ built: row.built, element: count });
    const order = row.is_ordered ? "in this order" : "in any order";
    list.append(make("li", { title: order }, make("span", {}, row.name), line, count));
  }
  store.listenSlowly(({ t }) => {
    for (const { built, element } of parts) element.classList.toggle("built", t >= built);
    for (const { built, element } of counts) {
      say(element, `${built.filter((at) => t >= at).length} of ${built.length}`);
    }
  });
  return list;
}

function facts(playback: Playback): HTMLElement {
  const list = make("dl", { class: "facts" });
  for (const [name, value] of playback.facts) {
    list.append(make("div", {}, make("dt", {}, name), make("dd", {}, value)));
  }
  return list;
}
