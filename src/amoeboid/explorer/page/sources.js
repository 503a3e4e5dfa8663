// Where answers come from: the server that gave the page, or the page itself.

export class Server {
  constructor(receive) {
    this.receive = receive;
    this.number = 0;
    this.closing = false;
    this.connect();
    addEventListener("pagehide", () => { this.closing = true; this.socket.close(); });
    addEventListener("pageshow", (event) => { if (event.persisted) { this.closing = false; this.connect(); } });
  }

  connect() {
    const address = new URL("live", location.href);
    address.protocol = "ws:";
    this.socket = new WebSocket(address);
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => this.receive({ kind: "opened" });
    this.socket.onclose = () => {
      if (this.closing) return;
      this.receive({ kind: "closed" });
      setTimeout(() => this.connect(), 1500);
    };
    this.socket.onmessage = ({ data }) => {
      if (typeof data === "string") return this.receive(JSON.parse(data));
      this.receive(frame(data));
      this.send({ ask: "ready" });
    };
  }

  send(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }

  ask(point) {
    this.number += 1;
    this.send({ ask: "answers", number: this.number, ...point });
    return this.number;
  }

  live(message) {
    this.send({ ask: "live", ...message });
  }

  async surface(file) {
    const name = new TextEncoder().encode(file.name);
    const length = new Uint8Array(new Uint32Array([name.length]).buffer);
    this.socket.send(new Blob([length, name, await file.arrayBuffer()]));
  }
}

function frame(data) {
  const [length] = new Uint32Array(data, 0, 1);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let place = 4 + length;
  header.fields = {};
  for (const [name, shape, kind] of header.arrays) {
    const count = shape.reduce((a, b) => a * b, 1);
    header.fields[name] = kind === "u" ? new Uint32Array(data, place, count) : new Float32Array(data, place, count);
    place += 4 * count;
  }
  return header;
}

// branches: one for each value of the slider `name`; states: one entry for each value of v_p0
export class Stored {
  constructor(receive, data) {
    this.receive = receive;
    this.data = data;
    this.number = 0;
    queueMicrotask(() => receive({ kind: "opened" }));
  }

  ask({ values }) {
    this.number += 1;
    const nearest = (list, wanted) => list.reduce((a, b) => (Math.abs(b - wanted) < Math.abs(a - wanted) ? b : a));
    const value = nearest(this.data.branches.map((b) => b.value), Number(values[this.data.name]));
    const found = this.data.branches.find((b) => b.value === value);
    const point = found.points[found.speeds.indexOf(nearest(found.speeds, Number(values.v_p0)))];
    for (const answer of [point.theory, found.branch, point.states]) this.receive({ ...answer, number: this.number });
    return this.number;
  }
}
