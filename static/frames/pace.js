// Runs in a pane's frame before viser's client: how often it draws.
//
// Where a graphics card draws, as often as it likes. Where a processor has to (WebGL in software), frames that come
// faster than they are drawn would pile up and keep the whole page waiting: there a pane draws without smoothing, the
// panes of a page take turns, none begins before the last picture is done, and one in which nothing happens rests.
(() => {
  const SOFTWARE = /swiftshader|llvmpipe|softpipe|basic render|software/i;
  /** A pane draws what is asked for so long after something happened in it, and then once in a while, ms: labels take time. */
  const AWAKE_MS = 5000;
  const REST_MS = 5000;
  /** A turn that is not given back is taken after so long, and who has not asked for one so long waits no more, ms. */
  const PATIENCE_MS = 2000;
  const GONE_MS = 300;

  const getContext = HTMLCanvasElement.prototype.getContext;
  const nextFrame = window.requestAnimationFrame.bind(window);
  const noFrame = window.cancelAnimationFrame.bind(window);
  const turns = (window.parent.paneTurns ??= { holder: null, since: 0, waiting: new Map() });
  let software = null;
  const met = new WeakSet();
  /** Of the contexts of this frame: what is drawn behind each. */
  const behind = new Map();
  /** The contexts until one of them has a picture, of which the page is told. */
  const blank = new Set();

  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    if (!String(kind).startsWith("webgl")) return getContext.call(this, kind, options);
    // What is drawn stays, for pictures of the pane.
    const context = getContext.call(this, kind, { ...options, preserveDrawingBuffer: true, antialias: software ? false : options?.antialias });
    if (context === null) return null;
    if (met.has(context)) return context;
    met.add(context);
    blank.add(context);
    software ??= inSoftware(context);
    if (software && kind === "webgl2") behind.set(context, window.drawBehind(context));
    return context;
  };

  function inSoftware(context) {
    const known = context.getExtension("WEBGL_debug_renderer_info");
    return known !== null && SOFTWARE.test(context.getParameter(known.UNMASKED_RENDERER_WEBGL));
  }

  const asked = new Map();
  let count = 0;
  let planned = 0;
  let resting = 0;
  /** Until there is a picture, and some time beyond: what comes last, as labels do, is to be in it. */
  let awakeUntil = Infinity;

  window.requestAnimationFrame = (callback) => {
    asked.set(++count, callback);
    plan();
    return count;
  };
  window.cancelAnimationFrame = (id) => asked.delete(id);

  function plan() {
    if (planned || resting) return;
    if (!software || performance.now() < awakeUntil) {
      planned = nextFrame(run);
    } else {
      resting = setTimeout(wake, REST_MS, 0);
    }
  }

  /** Draws what is asked for, and all that is asked for in the next while. */
  function wake(ms = AWAKE_MS) {
    awakeUntil = Math.max(awakeUntil, performance.now() + ms);
    if (!resting) return;
    clearTimeout(resting);
    resting = 0;
    planned = nextFrame(run);
  }

  function run(time) {
    if (software && !takeTurn()) {
      planned = nextFrame(run);
      return;
    }
    planned = 0;
    const callbacks = [...asked.values()];
    asked.clear();
    for (const callback of callbacks) {
      try {
        callback(time);
      } catch (error) {
        reportError(error);
      }
    }
    if (software) giveBack();
    else tell();
  }

  /** Tells the page once that there is a picture: before that canvases are transparent. */
  function tell() {
    const pixel = new Uint8Array(4);
    for (const gl of blank) {
      gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
      if (pixel[3] === 0) continue;
      blank.clear();
      awakeUntil = performance.now() + 2 * AWAKE_MS;
      window.frameElement?.dispatchEvent(new Event("picture"));
    }
  }

  /** Whether this pane may draw now: who waits longest goes first; a pane that is hidden or closed no longer waits. */
  function takeTurn() {
    const { waiting } = turns;
    const now = Date.now();
    const mine = { since: waiting.get(window)?.since ?? now, asked: now, begin };
    waiting.set(window, mine);
    for (const [other, { asked }] of waiting) if (now - asked > GONE_MS) waiting.delete(other);
    if (turns.holder !== null && now - turns.since < PATIENCE_MS) return false;
    for (const { since } of waiting.values()) if (since < mine.since) return false;
    waiting.delete(window);
    turns.holder = window;
    turns.since = now;
    return true;
  }

  /** Its turn has come: draws now, not with the next frame. */
  function begin() {
    noFrame(planned);
    run(performance.now());
  }

  /** Another pane may draw once this picture is done and the page has it. */
  function giveBack() {
    const made = [...behind.values()].filter((picture) => picture.drawn());
    const fences = made.map(({ gl }) => [gl, gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0)]);
    for (const { gl } of made) gl.flush();
    const done = ([gl, fence]) => gl.isContextLost() || fence === null || gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED;
    const look = () => {
      if (!fences.every(done) && turns.holder === window) {
        setTimeout(look, 4);
        return;
      }
      for (const [gl, fence] of fences) gl.deleteSync(fence);
      for (const picture of made) picture.show();
      if (made.length) nextFrame(() => setTimeout(release, 0));
      else release();
      tell();
    };
    const release = () => {
      if (turns.holder !== window) return;
      turns.holder = null;
      const first = [...turns.waiting].filter(([other, { asked }]) => !other.closed && Date.now() - asked <= GONE_MS);
      first.sort(([, a], [, b]) => a.since - b.since)[0]?.[1].begin();
    };
    setTimeout(look, 0);
  }

  const Native = window.Worker;
  window.Worker = class extends Native {
    constructor(...args) {
      super(...args);
      this.addEventListener("message", () => wake());
    }
  };
  for (const kind of ["pointerdown", "pointermove", "pointerup", "wheel", "keydown", "resize"]) {
    window.addEventListener(kind, () => wake(), { capture: true, passive: true });
  }
})();
