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
  const turns = (window.parent.paneTurns ??= { holder: null, since: 0, waiting: new Map() });
  let software = null;
  let gl = null;

  HTMLCanvasElement.prototype.getContext = function (kind, options) {
    if (!String(kind).startsWith("webgl")) return getContext.call(this, kind, options);
    // What is drawn stays, for pictures of the pane.
    const context = getContext.call(this, kind, { ...options, preserveDrawingBuffer: true, antialias: software ? false : options?.antialias });
    if (context !== null) {
      software ??= inSoftware(context);
      gl = context;
    }
    return context;
  };

  function inSoftware(context) {
    const known = context.getExtension("WEBGL_debug_renderer_info");
    return known !== null && SOFTWARE.test(context.getParameter(known.UNMASKED_RENDERER_WEBGL));
  }

  const asked = new Map();
  let count = 0;
  let planned = false;
  let resting = 0;
  let awakeUntil = performance.now() + 2 * AWAKE_MS;

  window.requestAnimationFrame = (callback) => {
    asked.set(++count, callback);
    plan();
    return count;
  };
  window.cancelAnimationFrame = (id) => asked.delete(id);

  function plan() {
    if (planned || resting) return;
    if (!software || performance.now() < awakeUntil) {
      planned = true;
      nextFrame(run);
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
    planned = true;
    nextFrame(run);
  }

  function run(time) {
    if (software && !takeTurn()) {
      nextFrame(run);
      return;
    }
    planned = false;
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
  }

  /** Whether this pane may draw now: who waits longest goes first; a pane that is hidden or closed no longer waits. */
  function takeTurn() {
    const { waiting } = turns;
    const now = Date.now();
    const mine = { since: waiting.get(window)?.since ?? now, asked: now };
    waiting.set(window, mine);
    for (const [other, { asked }] of waiting) if (now - asked > GONE_MS) waiting.delete(other);
    if (turns.holder !== null && now - turns.since < PATIENCE_MS) return false;
    for (const { since } of waiting.values()) if (since < mine.since) return false;
    waiting.delete(window);
    turns.holder = window;
    turns.since = now;
    return true;
  }

  /** Another pane may draw once this picture is done. */
  function giveBack() {
    const fence = gl?.fenceSync?.(gl.SYNC_GPU_COMMANDS_COMPLETE, 0) ?? null;
    gl?.flush();
    const look = () => {
      const done = fence === null || gl.isContextLost() || gl.getSyncParameter(fence, gl.SYNC_STATUS) === gl.SIGNALED;
      if (!done && turns.holder === window) {
        setTimeout(look, 4);
        return;
      }
      gl?.deleteSync?.(fence);
      if (turns.holder === window) turns.holder = null;
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
