// Renders an exported file once, through its camera, and sends back linear pixels.

import * as pc from 'playcanvas';
import { HemibakeLoader } from 'hemibake-playcanvas';

export async function render(asked) {
  const { width, height } = asked, canvas = document.createElement('canvas');
  const app = new pc.Application(canvas, { graphicsDeviceOptions: { deviceTypes: ['webgl2'], antialias: false } });
  app.scene.ambientLight = new pc.Color(0, 0, 0);
  // Only the frames below are drawn.
  app.autoRender = false;
  app.start();
  const room = await new HemibakeLoader(app).load(`/file/${encodeURIComponent(asked.file)}`);
  for (const [name, color, strength] of asked.groups) room.setGroup(name, color, strength);
  if (asked.state) await room.setState(asked.state, { seconds: asked.seconds });
  app.root.addChild(room.entity);
  for (const name of asked.hide) for (const node of room.entity.find(other => other.name === name)) node.enabled = false;

  const colorBuffer = new pc.Texture(app.graphicsDevice, { width, height, format: pc.PIXELFORMAT_RGBA32F, mipmaps: false });
  const [camera] = room.entity.findComponents('camera');
  Object.assign(camera, {
    enabled: true, clearColor: new pc.Color(...asked.background), gammaCorrection: pc.GAMMA_NONE, toneMapping: pc.TONEMAP_NONE,
    aspectRatioMode: pc.ASPECT_MANUAL, aspectRatio: width / height,
    renderTarget: new pc.RenderTarget({ colorBuffer, depth: true }),
  });
  for (let frame = 0; frame < 3; frame++) { app.update(0.016); app.render(); }
  return { pixels: await colorBuffer.read(0, 0, width, height), problems: room.problems };
}
