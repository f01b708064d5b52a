// Readers of JSON that nobody has vouched for: each returns what it promises or throws Damaged.

import { Channel, Damaged, type Pool } from "./data";

/** Reads a value; ``where`` names it in messages, channels lie in the pool. */
export type Read<A> = (value: unknown, where: string, pool: Pool) => A;
/** What a reader returns. */
export type Of<R> = R extends Read<infer A> ? A : never;

const wrong = (where: string, what: string) => new Damaged(`${where} is not ${what}`);

export const text: Read<string> = (value, where) => {
  if (typeof value !== "string") throw wrong(where, "text");
  return value;
};

export const number: Read<number> = (value, where) => {
  if (typeof value !== "number" || !Number.isFinite(value)) throw wrong(where, "a number");
  return value;
};

/** A length or a duration: a number that is not negative. */
export const length: Read<number> = (value, where, pool) => {
  const n = number(value, where, pool);
  if (n < 0) throw wrong(where, "a length");
  return n;
};

export const whole: Read<number> = (value, where) => {
  if (!Number.isSafeInteger(value)) throw wrong(where, "a whole number");
  return value as number;
};

/** A whole number that is not negative. */
export const count: Read<number> = (value, where, pool) => {
  const n = whole(value, where, pool);
  if (n < 0) throw wrong(where, "a count");
  return n;
};

export const yes: Read<boolean> = (value, where) => {
  if (typeof value !== "boolean") throw wrong(where, "true or false");
  return value;
};

/** "#rrggbb", or "" for none: nothing else may reach a style. */
export const colour: Read<string> = (value, where) => {
  if (typeof value !== "string" || !/^(#[0-9a-f]{6})?$/i.test(value))
    throw wrong(where, "a colour");
  return value;
};

/** One of some words. */
export const oneOf =
  <W extends string>(...words: W[]): Read<W> =>
  (value, where) => {
    if (!words.includes(value as W)) throw wrong(where, words.join(" or "));
    return value as W;
  };

/** A list; of exactly ``size`` members if that is given. */
export const list =
  <A>(read: Read<A>, size?: number): Read<A[]> =>
  (value, where, pool) => {
    if (!Array.isArray(value) || (size !== undefined && value.length !== size)) {
      throw wrong(where, size === undefined ? "a list" : `a list of ${size}`);
    }
    return value.map((part, k) => read(part, `${where}[${k}]`, pool));
  };

/** An object of the given fields; others are ignored. */
export const object =
  <A extends object>(fields: { [K in keyof A]: Read<A[K]> }): Read<A> =>
  (value, where, pool) => {
    if (typeof value !== "object" || value === null) throw wrong(where, "an object");
    const entries = Object.entries(fields) as [string, Read<unknown>][];
    const given = value as Record<string, unknown>;
    return Object.fromEntries(
      entries.map(([name, read]) => [name, read(given[name], `${where}.${name}`, pool)]),
    ) as A;
  };

/** The same, or null. */
export const maybe =
  <A>(read: Read<A>): Read<A | null> =>
  (value, where, pool) =>
    value === null || value === undefined ? null : read(value, where, pool);

export const channel: Read<Channel> = (value, where, pool) => {
  const place = object({ at: count, bytes: count, shape: list(count), low: number, step: number });
  const { at, bytes, shape, low, step } = place(value, where, pool);
  return pool.channel(at, bytes, shape, low, step);
};
