// Numbers of a trajectory as they are kept: small codes, each standing for a value.

const LARGEST = 1e15; // of a value: beyond it even whole numbers would not be exact

type Codes = Uint8Array | Uint16Array | Uint32Array;

/** The data are not what they should be; the message is for the reader of the page. */
export class Damaged extends Error {}

/** An array of numbers: value = low + step * code. Of [T, I, J] time runs fastest. */
export class Channel {
  constructor(
    readonly codes: Codes,
    readonly shape: readonly number[],
    readonly low: number,
    readonly step: number,
  ) {}

  /** Return the value at [first, i, j], as many as the channel has axes. */
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

/** All channels of a page in one piece of memory. */
export class Pool {
  constructor(private readonly memory: ArrayBuffer) {}

  /** Return the channel at a place. Throws Damaged if it reaches beyond the memory. */
  channel(at: number, bytes: number, shape: readonly number[], low: number, step: number): Channel {
    const count = shape.reduce((product, size) => product * size, 1);
    const kinds = { 1: Uint8Array, 2: Uint16Array, 4: Uint32Array };
    const Kind = kinds[bytes as 1 | 2 | 4];
    if (!Kind || at % bytes || at + bytes * count > this.memory.byteLength) {
      throw new Damaged("a channel lies outside of the data");
    }
    const top = low + step * (2 ** (8 * bytes) - 1);
    if (!(Math.abs(low) <= LARGEST && Math.abs(top) <= LARGEST)) {
      throw new Damaged("a channel has numbers beyond all measure");
    }
    return new Channel(new Kind(this.memory, at, count), shape, low, step);
  }
}

/** Return the pool of a page's text: base64 of zlib-compressed bytes. Throws Damaged. */
export async function inflate(base64: string): Promise<Pool> {
  try {
    const text = atob(base64);
    const bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    return new Pool(await new Response(stream).arrayBuffer());
  } catch {
    throw new Damaged("its numbers cannot be unpacked");
  }
}
