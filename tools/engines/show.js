// What the pages that render with an engine share: the question in the address, and the answer.

const send = (path, body) => fetch(path, { method: 'POST', body });

/** Sends { pixels, problems } that a function makes of the question, or its error. */
export async function answered(render) {
  try {
    const asked = JSON.parse(new URLSearchParams(location.search).get('asked'));
    const { pixels, problems } = await render(asked);
    await send('/problems', JSON.stringify(problems));
    await send('/pixels', pixels);
  } catch (error) {
    await send('/error', `${error.stack ?? error}`);
  }
}
