/** The token in the fragment of an address, which browsers send to nobody; null where there is none. */
export function tokenIn(fragment: string): string | null {
  const token = /^#(?:.*&)?token=([^&]+)/.exec(fragment)?.[1];
  if (token === undefined) return null;
  try {
    return decodeURIComponent(token);
  } catch {
    return token; // it holds a percent sign as it is
  }
}

/** Takes the token out of the page's address, so that it is neither seen nor copied with it. */
export function takeTokenFromAddress(): string | null {
  const token = tokenIn(location.hash);
  if (token !== null) history.replaceState(history.state, "", location.pathname + location.search);
  return token;
}

type Storage = Pick<globalThis.Storage, "getItem" | "setItem" | "removeItem">;

/** The token of one gateway, kept for as long as the tab is open. */
export class TokenKeeper {
  private token: string | null;
  private readonly key: string;

  /** `storage`: null where the browser lends none; then it is kept until the page is left. */
  constructor(gateway: string, private readonly storage: Storage | null) {
    this.key = `meshreduce token of ${gateway}`;
    this.token = this.tryStorage((store) => store.getItem(this.key));
  }

  get(): string | null {
    return this.token;
  }

  keep(token: string): void {
    this.token = token;
    this.tryStorage((store) => store.setItem(this.key, token));
  }

  /** It was refused. */
  forget(): void {
    this.token = null;
    this.tryStorage((store) => store.removeItem(this.key));
  }

  private tryStorage<T>(act: (store: Storage) => T): T | null {
    try {
      return this.storage === null ? null : act(this.storage);
    } catch {
      return null; // full, or forbidden
    }
  }
}

export function sessionStorageOrNull(): globalThis.Storage | null {
  try {
    return window.sessionStorage;
  } catch {
    return null; // forbidden in this browser
  }
}
