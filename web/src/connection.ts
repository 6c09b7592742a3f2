// The connection: it opens again by itself, and says how it stands.
import { decodeBinary, decodeText } from "./decode";
import type { Answer, Command, FromServer, Hello, State } from "./messages";
import { HISTORY, PROTOCOL } from "./messages";
import type { Rows } from "./panel";

export type Standing = "connecting" | "connected" | "waiting" | "refused" | "version";
const SHORTEST = 500;
const LONGEST = 5000;
const UNANSWERED = 10_000;

export interface Sockets {
  /** Open one; `since` is the number of the newest event that is known. */
  open(since: number | null): WebSocket;
  /** Status of the page itself: 401 where the token is missing; 0 where nobody answers. */
  status(): Promise<number>;
}

export interface Heard {
  standing(standing: Standing, why: string): void;
  hello(hello: Hello, first: boolean): void;
  rows(rows: Rows, history: boolean): void;
  state(state: State): void;
  other(message: Exclude<FromServer, Hello | State | Answer>): void;
}

/** Sockets of the page's own address. */
export const ownSockets: Sockets = {
  open(since) {
    const address = new URL("./ws", location.href);
    address.protocol = address.protocol.replace("http", "ws");
    address.search = since === null ? "" : `?since=${since}`;
    address.hash = "";
    return new WebSocket(address);
  },
  async status() {
    try {
      return (await fetch("./", { cache: "no-store", redirect: "manual" })).status;
    } catch {
      return 0;
    }
  },
};

export class Connection {
  standing: Standing = "connecting";
  private socket: WebSocket | null = null;
  private wait = SHORTEST;
  private next = 1;
  private first = true;
  private event: number | null = null;
  private readonly asked = new Map<number, (answer: Answer) => void>();

  constructor(private readonly heard: Heard, private readonly sockets: Sockets = ownSockets) {}

  start(): void {
    this.stand("connecting", "");
    this.first = true;
    const socket = this.sockets.open(this.event);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    let opened = false;
    socket.onopen = () => {
      opened = true;
    };
    socket.onmessage = (event: MessageEvent<string | ArrayBuffer>) => {
      if (this.socket === socket) this.take(event.data);
    };
    socket.onclose = (event) => {
      if (this.socket === socket) void this.lost(opened, event.reason);
    };
  }

  /** Send a command; the answer says whether it was done. */
  send(command: Omit<Command, "id">): Promise<Answer> {
    const id = this.next++;
    if (this.socket?.readyState !== 1) return Promise.resolve({ type: "answer", id, ok: false, text: "there is no connection" });
    this.socket.send(JSON.stringify({ id, ...command }));
    return new Promise((resolve) => {
      const timer = setTimeout(() => this.answered({ type: "answer", id, ok: false, text: "the server has not answered" }), UNANSWERED);
      this.asked.set(id, (answer) => {
        clearTimeout(timer);
        resolve(answer);
      });
    });
  }

  private stand(standing: Standing, why: string): void {
    this.standing = standing;
    this.heard.standing(standing, why);
  }

  private take(data: string | ArrayBuffer): void {
    if (this.standing === "version") return;
    if (typeof data !== "string") {
      const { kind, state, rows } = decodeBinary(data);
      this.heard.rows(rows, kind === HISTORY);
      if (state) this.heard.state(state);
      return;
    }
    const message = decodeText(data);
    if (message === null) return;
    if (message.type === "hello") this.greeted(message);
    else if (message.type === "answer") this.answered(message);
    else if (message.type === "state") this.heard.state(message);
    else {
      if (message.type === "event") this.event = message.id;
      this.heard.other(message);
    }
  }

  private greeted(hello: Hello): void {
    if (hello.protocol !== PROTOCOL) {
      this.stand("version", String(hello.protocol));
      this.socket?.close();
      return;
    }
    this.wait = SHORTEST;
    this.stand("connected", "");
    this.heard.hello(hello, this.first);
    this.first = false;
  }

  private answered(answer: Answer): void {
    this.asked.get(answer.id)?.(answer);
    this.asked.delete(answer.id);
  }

  private async lost(opened: boolean, reason: string): Promise<void> {
    this.socket = null;
    for (const id of [...this.asked.keys()]) this.answered({ type: "answer", id, ok: false, text: "the connection was lost" });
    if (this.standing === "version") return;
    const wait = this.wait;
    this.wait = Math.min(LONGEST, wait * 2);
    this.stand("waiting", reason);
    // A browser does not say why a socket did not open: the page's own address does.
    if (!opened && (await this.sockets.status()) === 401) this.stand("refused", "");
    setTimeout(() => this.start(), wait);
  }
}
