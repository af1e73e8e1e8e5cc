// A running meshreduce, as a test needs it.
import { spawn } from "node:child_process";

export class Server {
  /** Starts `program` with these arguments and waits for its address. */
  static async start(program, args) {
    const server = new Server();
    server.child = spawn(program, args, { stdio: ["ignore", "pipe", "pipe"] });
    server.output = "";
    server.child.stderr.on("data", (text) => (server.output += text));
    server.url = await new Promise((resolve, reject) => {
      server.child.stdout.on("data", (text) => {
        server.output += text;
        const found = /http:\/\/[\w.:[\]]+/.exec(server.output);
        if (found) resolve(found[0]);
      });
      server.child.on("exit", (code) => reject(new Error(`${program} ended with ${code}: ${server.output}`)));
    });
    return server;
  }
  get port() {
    return Number(new URL(this.url).port);
  }
  async stop(signal = "SIGTERM") {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    const ended = new Promise((resolve) => this.child.on("exit", resolve));
    this.child.kill(signal);
    await ended;
  }
}
