// A page that was opened as a file may start no worker, and the search runs in one. So here a worker is a hidden frame:
// it runs the same script, and what the script hands to importScripts and postMessage goes through the frame's window.
// This stands in for https://unpkg.com/iframe-worker, which the theme would fetch.
if (location.protocol === "file:") {
  const inside = (script) => `<!doctype html><script>
    window.postMessage = (data) => window.frameElement.worker.receive(data);
    window.importScripts = async (...urls) => {
      for (const src of urls)
        await new Promise((loaded) => document.head.append(Object.assign(document.createElement("script"), { src, onload: loaded })));
    };
  <\/script><script src="${script}"><\/script>`;

  // The second name is how the theme's script knows that it runs in a frame, and where its languages lie.
  window.Worker = window.IFrameWorker = class extends EventTarget {
    constructor(url) {
      super();
      this.frame = Object.assign(document.createElement("iframe"), { hidden: true, worker: this });
      this.ready = new Promise((loaded) => this.frame.addEventListener("load", loaded));
      this.frame.srcdoc = inside(new URL(url, document.baseURI).href);
      document.body.append(this.frame);
    }
    receive(data) {
      this.dispatchEvent(new MessageEvent("message", { data }));
    }
    postMessage(data) {
      this.ready.then(() => this.frame.contentWindow.dispatchEvent(new MessageEvent("message", { data })));
    }
    terminate() {
      this.frame.remove();
    }
  };
}
