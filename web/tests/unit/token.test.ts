import assert from "node:assert/strict";
import { test } from "node:test";
import { tokenIn, TokenKeeper } from "../../src/token.ts";

function fakeStorage(): Pick<Storage, "getItem" | "setItem" | "removeItem"> & { readonly items: Map<string, string> } {
  const items = new Map<string, string>();
  return {
    items,
    getItem: (key) => items.get(key) ?? null,
    setItem: (key, value) => void items.set(key, value),
    removeItem: (key) => void items.delete(key),
  };
}

test("the token of an address", () => {
  assert.equal(tokenIn("#token=abc"), "abc");
  assert.equal(tokenIn("#token=a+b/c%3D"), "a+b/c=", "plus is no blank");
  assert.equal(tokenIn("#x=1&token=abc&y=2"), "abc");
  assert.equal(tokenIn("#token=100%"), "100%");
  for (const none of ["", "#", "#token=", "#mytoken=abc", "#token"]) assert.equal(tokenIn(none), null, none);
});

test("a token outlives the page, goes to its own gateway only, and is gone when it is refused", () => {
  const storage = fakeStorage();
  new TokenKeeper("wss://one/stream", storage).keep("abc");
  assert.equal(new TokenKeeper("wss://one/stream", storage).get(), "abc");
  assert.equal(new TokenKeeper("wss://two/stream", storage).get(), null);
  new TokenKeeper("wss://one/stream", storage).forget();
  assert.equal(new TokenKeeper("wss://one/stream", storage).get(), null);
  assert.equal(storage.items.size, 0);
});

test("a browser that stores nothing keeps the token while the page is open", () => {
  const forbidden = (): never => {
    throw new Error("forbidden");
  };
  for (const storage of [null, { getItem: forbidden, setItem: forbidden, removeItem: forbidden }]) {
    const tokens = new TokenKeeper("wss://one/stream", storage);
    assert.equal(tokens.get(), null);
    tokens.keep("abc");
    assert.equal(tokens.get(), "abc");
    tokens.forget();
    assert.equal(tokens.get(), null);
  }
});
