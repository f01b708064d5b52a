// Elements made and found in one line. Texts are inserted as text, never as markup.

type Child = Node | string;
type Given = Record<string, string | number | boolean | ((event: Event) => void)>;

/** Return a new element: "on..." attributes are listeners, true sets one, false omits it. */
export function make<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  given: Given = {},
  ...children: Child[]
): HTMLElementTagNameMap[K] {
  const element = document.createElement(tag);
  for (const [name, value] of Object.entries(given)) {
    if (typeof value === "function") element.addEventListener(name.slice(2), value);
    else if (value === true) element.setAttribute(name, "");
    else if (value !== false) element.setAttribute(name, String(value));
  }
  element.append(...children);
  return element;
}

/** Return the element of an id.
 *
 * Throws an Error if the page has none, or one of another type.
 */
export function find<E extends HTMLElement>(id: string, type: new () => E): E {
  const element = document.getElementById(id);
  if (!(element instanceof type)) throw new Error(`no #${id} in the page`);
  return element;
}

/** Set an element's text; the page is not laid out again if it has that text already. */
export function say(element: HTMLElement, text: string): void {
  if (element.textContent !== text) element.textContent = text;
}

/** Return a name for a legend, cut if it is very long. */
export function named(text: string): HTMLElement {
  return make("span", { class: "name", title: text }, text);
}

/** Return a small square of a colour, for legends. */
export function swatch(colour: string): HTMLElement {
  const square = make("i", { class: "swatch", "aria-hidden": "true" });
  square.style.background = colour;
  return square;
}
