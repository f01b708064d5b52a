// The stored numbers of a trajectory: small codes, each for a value.

import type { Playback } from "./playback";

type Codes = Uint8Array | Uint16Array | Uint32Array;

/** An array of numbers: value = low + step * code. Of [T, I, J] time runs fastest. */
export class Channel {
  constructor(
    readonly codes: Codes,
    readonly shape: readonly number[],
    readonly low: number,
    readonly step: number,
  ) {}

  /** Return the value at [first, i, j], an index for each axis of the channel. */
  at(first: number, i = 0, j = 0): number {
    const [n = 1, m = 1] = this.shape;
    return this.low + this.step * this.codes[first + n * (i + m * j)]!;
  }

  /** Return the value of [K] at k, or that of [T, K] at [t, k]. */
  of(t: number, k: number): number {
    return this.shape.length === 1 ? this.at(k) : this.at(t, k);
  }

  /** Return the least and the largest value, both 0 if there is none. */
  range(): [number, number] {
    if (!this.codes.length) return [0, 0];
    let [least, most] = [Infinity, 0];
    for (const code of this.codes) {
      if (code < least) least = code;
      if (code > most) most = code;
    }
    return [this.low + this.step * least, this.low + this.step * most];
  }
}

/** A channel in JSON: the place of its codes in the page's memory. */
interface Place {
  readonly at: number;
  readonly bytes: 1 | 2 | 4;
  readonly shape: readonly number[];
  readonly low: number;
  readonly step: number;
}

/** Return the playbacks of a page's teams from its JSON, with the channels in its memory. */
export function readPlaybacks(json: string, memory: ArrayBuffer): Playback[] {
  const kinds = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };
  const revive = (_: string, value: unknown) => {
    if (typeof value !== "object" || value === null || !("bytes" in value)) return value;
    const { at, bytes, shape, low, step } = value as Place;
    const count = shape.reduce((product, size) => product * size, 1);
    return new Channel(new kinds[bytes](memory, at, count), shape, low, step);
  };
  return JSON.parse(json, revive).teams;
}

/** Return the memory from a page's text: base64 of zlib-compressed bytes. */
export async function inflate(base64: string): Promise<ArrayBuffer> {
  const bytes = Uint8Array.from(atob(base64), (sign) => sign.charCodeAt(0));
  const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
  return new Response(stream).arrayBuffer();
}
