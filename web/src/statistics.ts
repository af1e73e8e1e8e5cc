/** Amounts per second over the last seconds. */
export class Rate {
  private readonly entries: { at: number; amount: number }[] = [];

  constructor(private readonly windowMs = 2000) {}

  add(nowMs: number, amount: number): void {
    this.entries.push({ at: nowMs, amount });
    this.forget(nowMs);
  }

  perSecond(nowMs: number): number {
    this.forget(nowMs);
    return this.entries.reduce((sum, entry) => sum + entry.amount, 0) / (this.windowMs / 1000);
  }

  private forget(nowMs: number): void {
    while (this.entries.length > 0 && this.entries[0]!.at < nowMs - this.windowMs) this.entries.shift();
  }
}

/** The middle one of the last values. */
export class Median {
  private readonly values: number[] = [];

  constructor(private readonly most = 60) {}

  add(value: number): void {
    this.values.push(value);
    if (this.values.length > this.most) this.values.shift();
  }

  value(): number | null {
    return [...this.values].sort((a, b) => a - b)[Math.floor(this.values.length / 2)] ?? null;
  }
}
