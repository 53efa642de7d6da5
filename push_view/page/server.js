// Requests to the server of this page.

const RETRY = 1000;   // [ms] until a refused stream is asked for again

export async function get(what) {
  const answer = await fetch(what);
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer.json();
}

export async function ask(what, body = {}) {
  const headers = {"Content-Type": "application/json"};
  const answer = await fetch(what, {method: "POST", headers, body: JSON.stringify(body)});
  if (!answer.ok) throw new Error((await answer.text()).trim());
  return answer.json();
}

// Listen to the server's events while the page is visible. A browser opens few connections to a server,
// and pages in hidden tabs must leave them to those that are seen.
// kinds: names of events; take(kind, data): called for each; refused(text): called with why the server
// gives no stream, or with an empty text
export function listen(kinds, take, refused) {
  let events = null;
  const begin = () => {
    if (document.hidden || events) return;
    const mine = events = new EventSource("events");
    for (const kind of kinds) {
      mine.addEventListener(kind, event => { refused(""); take(kind, JSON.parse(event.data)); });
    }
    mine.onerror = async () => {
      if (mine !== events || mine.readyState !== EventSource.CLOSED) return;   // it tries again by itself
      const answer = await fetch("events", {signal: AbortSignal.timeout(RETRY)}).catch(() => null);
      if (answer && !answer.ok) refused(await answer.text());
      else answer?.body?.cancel();
      setTimeout(() => { if (mine === events) { events = null; begin(); } }, RETRY);
    };
  };
  document.addEventListener("visibilitychange", () => {
    if (document.hidden) { events?.close(); events = null; } else begin();
  });
  begin();
}
