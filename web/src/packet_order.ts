/** Where a packet stands among those before it. `afresh`: what was before is void. The others are refused. */
export type Place = "next" | "afresh" | "stale" | "jumps";

const kMostAhead = 4096n;
const kStuckMs = 1000;
const kStuckRefusals = 2;
const kLargest = BigInt(Number.MAX_SAFE_INTEGER); // beyond that two sequence numbers can look the same

/** The order of one node's packets, so that neither one that is sent again nor one with an absurd number ends the stream.
 *  No clock inside. */
export class PacketOrder {
  private last: { readonly epoch: number; readonly sequence: bigint } | null = null;
  private acceptedMs = 0;
  private refusals = 0; // since the last one that was accepted

  /** The next packet is the first, whatever its numbers are. */
  startAfresh(): void {
    this.last = null;
    this.refusals = 0;
  }

  /** To be asked before anything else of a packet is read; what is not refused is the newest from then on. */
  place(nowMs: number, epoch: number, sequence: bigint): Place {
    const place = this.placeOf(nowMs, epoch, sequence);
    if (place === "stale" || place === "jumps") {
      ++this.refusals;
      return place;
    }
    this.last = { epoch, sequence };
    this.acceptedMs = nowMs;
    this.refusals = 0;
    return place;
  }

  private placeOf(nowMs: number, epoch: number, sequence: bigint): Place {
    if (sequence > kLargest) return "jumps";
    if (this.last === null || this.isStuck(nowMs)) return "afresh";
    // 32-bit serial numbers: the epoch after the largest is 0.
    if (epoch !== this.last.epoch) return ((epoch - this.last.epoch) | 0) > 0 ? "afresh" : "stale";
    if (sequence <= this.last.sequence) return "stale";
    return sequence - this.last.sequence > kMostAhead ? "jumps" : "next";
  }

  /** Then it is the last accepted packet that was wrong, not those that are refused because of it. */
  private isStuck(nowMs: number): boolean {
    return this.refusals >= kStuckRefusals && nowMs - this.acceptedMs >= kStuckMs;
  }
}
