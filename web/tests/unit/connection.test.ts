import assert from "node:assert/strict";
import { test, type TestContext } from "node:test";
import { Connection } from "../../src/connection.ts";

class FakeSocket extends EventTarget {
  static readonly OPEN = 1;
  static made: FakeSocket[] = [];
  readyState = 1;
  readonly sent: string[] = [];
  constructor(readonly url: string) {
    super();
    FakeSocket.made.push(this);
  }
  send(text: string): void {
    this.sent.push(text);
  }
  close(): void {
    this.readyState = 3;
  }
  open(): void {
    this.dispatchEvent(new Event("open"));
  }
  say(data: object | ArrayBuffer): void {
    this.dispatchEvent(new MessageEvent("message", { data: data instanceof ArrayBuffer ? data : JSON.stringify(data) }));
  }
  end(code: number, reason: string): void {
    this.dispatchEvent(Object.assign(new Event("close"), { code, reason }));
  }
}

const kHello = { type: "hello", scene: "demo", up: [0, 0, 1], fps: 30, lattice: { low_corner: [0, 0, 0], step: 0.5 } };

/** A connection over sockets that the test drives, with a clock of its own. */
function connect(t: TestContext) {
  FakeSocket.made = [];
  Object.assign(globalThis, { WebSocket: FakeSocket, window: globalThis });
  t.mock.timers.enable({ apis: ["setInterval", "setTimeout"] });
  let nowMs = 0;
  t.mock.method(performance, "now", () => nowMs);
  const states: string[] = [];
  const tokens: { now: string | null; refusals: number } = { now: null, refusals: 0 };
  const connection = new Connection("ws://here", {
    onHello: () => {},
    onBytes: () => true,
    onState: (state, reason) => states.push(reason === "" ? state : `${state}: ${reason}`),
    token: () => tokens.now,
    onTokenRefused: () => ++tokens.refusals,
  });
  t.after(() => connection.close());
  const pass = (ms: number): void => {
    for (const end = nowMs + ms; nowMs < end; t.mock.timers.tick(50)) nowMs += 50;
  };
  const socket = (): FakeSocket => FakeSocket.made.at(-1)!;
  const opened = (): FakeSocket => {
    connection.open();
    socket().open();
    return socket();
  };
  return { connection, states, tokens, pass, socket, opened };
}

test("a connection that says nothing for five pings is given up and made anew", (t) => {
  const { states, pass, opened } = connect(t);
  const first = opened();
  for (let s = 0; s < 20; ++s) {
    first.say({ type: "pong", id: 1, server_ms: 0 });
    pass(1000);
  }
  assert.equal(FakeSocket.made.length, 1, "whoever answers stays");
  pass(4000);
  assert.equal(FakeSocket.made.length, 1);
  pass(1000);
  assert.ok(states.includes("lost"));
  pass(1000);
  assert.equal(FakeSocket.made.length, 2);
});

test("the gateway has the first word", (t) => {
  const { states, pass, opened } = connect(t);
  const socket = opened();
  pass(2500);
  assert.deepEqual(socket.sent, []);
  socket.say(kHello);
  assert.deepEqual(socket.sent.map((text) => JSON.parse(text)), [{ type: "ping", id: 1 }]);
  assert.deepEqual(states, ["waiting"]);
});

test("a locked gateway gets the token before all else, and is as any other then", (t) => {
  const { states, tokens, pass, opened } = connect(t);
  tokens.now = 'a"b';
  const socket = opened();
  pass(300);
  socket.say({ type: "locked" });
  socket.say({ type: "locked" });
  pass(1500);
  assert.deepEqual(socket.sent.map((text) => JSON.parse(text)), [{ type: "token", token: 'a"b' }], "once");
  socket.say(kHello);
  assert.equal(JSON.parse(socket.sent[1]!).type, "ping");
  assert.deepEqual(states, ["waiting"]);
  socket.end(1008, "a text message that is none of ours");
  assert.equal(tokens.refusals, 0, "it is not the token");
  assert.deepEqual(states.at(-1), "lost: a text message that is none of ours");
});

test("without a token, or when it is refused, nothing is tried before one is given", (t) => {
  const { connection, states, tokens, pass, socket, opened } = connect(t);
  opened().say({ type: "locked" });
  assert.deepEqual(states, ["locked"]);
  pass(60_000);
  assert.equal(FakeSocket.made.length, 1);
  assert.equal(socket().readyState, 3, "nothing is held open meanwhile");
  tokens.now = "wrong";
  opened().say({ type: "locked" });
  socket().end(1008, "wrong token");
  assert.deepEqual(states.at(-1), "locked: wrong token");
  assert.equal(tokens.refusals, 1);
  pass(60_000);
  assert.equal(FakeSocket.made.length, 2);
  connection.open();
  assert.equal(FakeSocket.made.length, 3);
});

test("a network that fails while the token is looked at refuses nothing", (t) => {
  const { states, tokens, pass, socket, opened } = connect(t);
  tokens.now = "right";
  opened().say({ type: "locked" });
  socket().end(1006, "");
  assert.deepEqual(states, ["lost"]);
  assert.equal(tokens.refusals, 0);
  pass(300);
  assert.equal(FakeSocket.made.length, 2, "and it tries again");
});

test("why the gateway closes is told until it says hello again", (t) => {
  const { states, pass, socket, opened } = connect(t);
  opened().say(kHello);
  socket().end(1013, "too many viewers, try again later");
  pass(300);
  assert.deepEqual(states, ["waiting", "lost: too many viewers, try again later", "connecting: too many viewers, try again later"]);
  socket().open();
  socket().say(kHello);
  assert.deepEqual(states.at(-1), "waiting");
});

test("silence is told before two seconds have passed", (t) => {
  const { states, pass, opened } = connect(t);
  const socket = opened();
  socket.say(kHello);
  for (let i = 0; i < 10; ++i) {
    socket.say(new ArrayBuffer(1));
    pass(1500);
  }
  assert.deepEqual(states, ["waiting", "live"], "one capture in a second and a half is none");
  socket.say(new ArrayBuffer(1));
  pass(1650);
  assert.equal(states.at(-1), "live");
  pass(250);
  assert.equal(states.at(-1), "silent");
});

test("a recording that has ended is not silent, and goes on when a packet comes all the same", (t) => {
  const { states, pass, opened } = connect(t);
  const socket = opened();
  socket.say(kHello);
  socket.say(new ArrayBuffer(1));
  socket.say({ type: "stopped", after_ms: 1500 });
  socket.say({ type: "stopped", after_ms: 2500, ended: true });
  for (let id = 1; id < 9; ++id) {
    pass(1000);
    socket.say({ type: "pong", id, server_ms: 0 });
  }
  assert.deepEqual(states, ["waiting", "live", "silent", "ended"]);
  socket.say(new ArrayBuffer(1));
  assert.equal(states.at(-1), "live");
});

test("a sequence number is acknowledged as it is, however large", (t) => {
  const { connection, opened } = connect(t);
  const socket = opened();
  connection.acknowledge(2n ** 64n - 1n);
  connection.acknowledge(7);
  assert.deepEqual(socket.sent, ['{"type":"shown","sequence":18446744073709551615}', '{"type":"shown","sequence":7}']);
});
