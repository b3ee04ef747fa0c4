// Runs in a pane's frame before viser's client: where a processor draws (WebGL in software), pictures are drawn behind
// the canvas and put on it when they are done.
//
// A browser that composes its pages without a graphics card reads every canvas back that was drawn on, and the page
// waits for that: for the whole picture, if it was only just asked for. So what is drawn goes to a framebuffer of ours
// instead of the canvas' own; once it is done, copying it takes next to nothing.

/**
 * Draws on a framebuffer behind the canvas of a WebGL 2 context; returns {gl, drawn(), show()}: whether there is a picture
 * that the canvas has not, and what puts it there.
 */
window.drawBehind = (gl) => {
  const native = {};
  for (const name of ["bindFramebuffer", "drawBuffers", "clear", "deleteFramebuffer"]) native[name] = gl[name].bind(gl);
  /** What is bound as the client has it; null is the canvas. */
  const bound = { [gl.READ_FRAMEBUFFER]: null, [gl.DRAW_FRAMEBUFFER]: null };
  let behind = null;
  let [width, height] = [0, 0];
  let drawn = false;

  /** The framebuffer in the canvas' size. */
  function backing() {
    const { drawingBufferWidth, drawingBufferHeight } = gl;
    if (behind === null || width !== drawingBufferWidth || height !== drawingBufferHeight) make(drawingBufferWidth, drawingBufferHeight);
    return behind.framebuffer;
  }

  function make(...size) {
    [width, height] = size;
    if (behind !== null) {
      native.deleteFramebuffer(behind.framebuffer);
      behind.buffers.forEach((buffer) => gl.deleteRenderbuffer(buffer));
    }
    const framebuffer = gl.createFramebuffer();
    const before = gl.getParameter(gl.RENDERBUFFER_BINDING);
    native.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
    const parts = [[gl.RGBA8, gl.COLOR_ATTACHMENT0], [gl.DEPTH24_STENCIL8, gl.DEPTH_STENCIL_ATTACHMENT]];
    const buffers = parts.map(([format, place]) => {
      const buffer = gl.createRenderbuffer();
      gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
      gl.renderbufferStorage(gl.RENDERBUFFER, format, Math.max(width, 1), Math.max(height, 1));
      gl.framebufferRenderbuffer(gl.FRAMEBUFFER, place, gl.RENDERBUFFER, buffer);
      return buffer;
    });
    behind = { framebuffer, buffers };
    gl.bindRenderbuffer(gl.RENDERBUFFER, before);
    rebind();
  }

  /** What the client has bound is bound. */
  function rebind() {
    for (const [target, framebuffer] of Object.entries(bound)) native.bindFramebuffer(Number(target), framebuffer ?? behind.framebuffer);
  }

  gl.bindFramebuffer = (target, framebuffer) => {
    for (const one of target === gl.FRAMEBUFFER ? [gl.READ_FRAMEBUFFER, gl.DRAW_FRAMEBUFFER] : [target]) bound[one] = framebuffer;
    native.bindFramebuffer(target, framebuffer ?? backing());
  };
  gl.deleteFramebuffer = (framebuffer) => {
    for (const target of Object.keys(bound)) if (framebuffer !== null && bound[target] === framebuffer) bound[target] = null;
    native.deleteFramebuffer(framebuffer);
    if (behind !== null) rebind();
  };
  gl.drawBuffers = (buffers) => native.drawBuffers(bound[gl.DRAW_FRAMEBUFFER] === null ? buffers.map((b) => (b === gl.BACK ? gl.COLOR_ATTACHMENT0 : b)) : buffers);
  gl.clear = (mask) => {
    if (bound[gl.DRAW_FRAMEBUFFER] === null) {
      backing();
      drawn = true;
    }
    native.clear(mask);
  };
  gl.canvas.addEventListener("webglcontextrestored", () => {
    behind = null;
    bound[gl.READ_FRAMEBUFFER] = bound[gl.DRAW_FRAMEBUFFER] = null;
    backing();
  }, { capture: true });
  backing();

  function show() {
    drawn = false;
    // A canvas that has another size by now waits for its next picture.
    if (gl.isContextLost() || width !== gl.drawingBufferWidth || height !== gl.drawingBufferHeight) return;
    const scissors = gl.isEnabled(gl.SCISSOR_TEST);
    if (scissors) gl.disable(gl.SCISSOR_TEST);
    native.bindFramebuffer(gl.READ_FRAMEBUFFER, behind.framebuffer);
    native.bindFramebuffer(gl.DRAW_FRAMEBUFFER, null);
    gl.blitFramebuffer(0, 0, width, height, 0, 0, width, height, gl.COLOR_BUFFER_BIT, gl.NEAREST);
    rebind();
    if (scissors) gl.enable(gl.SCISSOR_TEST);
  }

  return { gl, drawn: () => drawn, show };
};
