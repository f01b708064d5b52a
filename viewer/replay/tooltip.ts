// A line of text next to the pointer.

import { make, say } from "../shared/dom";

export class Tooltip {
  private readonly element = make("div", { class: "tooltip", hidden: true, "aria-hidden": "true" });

  constructor() {
    document.body.append(this.element);
  }

  /** Show a text next to a point of the window. */
  show(x: number, y: number, text: string): void {
    const { element } = this;
    say(element, text);
    element.hidden = false;
    const left = Math.min(x + 14, window.innerWidth - element.offsetWidth - 4);
    const isLow = y + 18 + element.offsetHeight > window.innerHeight;
    const top = isLow ? y - element.offsetHeight - 8 : y + 18;
    element.style.transform = `translate(${Math.max(left, 0)}px, ${top}px)`;
  }

  hide(): void {
    this.element.hidden = true;
  }
}
