// Renders an exported file once, through its camera, and sends back linear pixels.

import { Color4, Constants, Engine, RenderTargetTexture, Scene } from '@babylonjs/core';
import '@babylonjs/loaders/glTF/2.0/index.js';
import { HemibakeLoader } from 'hemibake-babylon';

export async function render(asked) {
  const { width, height } = asked, engine = new Engine(document.createElement('canvas'), false);
  engine.setSize(width, height);
  const scene = new Scene(engine);
  // A post-process would convert to sRGB: the pixels of materials stay linear.
  scene.imageProcessingConfiguration.applyByPostProcess = true;
  const room = await new HemibakeLoader(scene).load(`/file/${encodeURIComponent(asked.file)}`);
  for (const [name, color, strength] of asked.groups) room.setGroup(name, color, strength);
  if (asked.state) await room.setState(asked.state, { seconds: asked.seconds });
  const shown = room.meshes.filter(mesh => !asked.hide.includes(mesh.name));

  const target = new RenderTargetTexture('picture', { width, height }, scene, {
    type: Constants.TEXTURETYPE_FLOAT, generateMipMaps: false,
  });
  const clearColor = new Color4(...asked.background, 1);
  Object.assign(target, { renderList: shown, activeCamera: scene.cameras[0], clearColor });
  scene.activeCamera = scene.cameras[0];
  scene.customRenderTargets.push(target);
  await scene.whenReadyAsync(true);
  for (let frame = 0; frame < 3; frame++) scene.render();
  return { pixels: new Float32Array((await target.readPixels()).buffer), problems: room.problems };
}
