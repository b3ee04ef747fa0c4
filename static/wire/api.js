// The server's REST interface; every refusal becomes a Problem, a server out of reach Unreachable.

/** problem+json as an error: status, title, detail, and errors [{key, message, remedy}]. */
export class Problem extends Error {
  constructor({ status = 0, title = "Something went wrong", detail = "", errors = [] }) {
    super(detail || title);
    Object.assign(this, { name: "Problem", status, title, detail, errors });
  }
}

/** No answer at all. */
export class Unreachable extends Error {
  constructor() {
    super("The server does not answer.");
    this.name = "Unreachable";
  }
}

/** The problem an unsuccessful response tells of. */
export async function problemOf(response) {
  let body = {};
  try {
    body = await response.json();
  } catch {
    body = { detail: `The server answered ${response.status} ${response.statusText}.` };
  }
  const known = body !== null && typeof body === "object" ? body : {};
  return new Problem({ ...known, status: response.status, errors: Array.isArray(known.errors) ? known.errors : [] });
}

/** `body` goes as JSON, `raw` as it is, of a media type. */
async function request(path, { method = "GET", body, raw, type = "application/json", headers = {}, signal } = {}) {
  let response;
  try {
    response = await fetch(path, {
      method,
      signal,
      headers: body === undefined && raw === undefined ? headers : { "content-type": type, ...headers },
      body: body === undefined ? raw : JSON.stringify(body),
    });
  } catch (error) {
    if (error.name === "AbortError") throw error;
    throw new Unreachable();
  }
  if (!response.ok) throw await problemOf(response);
  const text = await response.text();
  return text === "" ? null : JSON.parse(text);
}

const job = (id) => `/api/jobs/${encodeURIComponent(id)}`;

export const health = (signal) => request("/api/health", { signal });
export const algorithms = () => request("/api/algorithms");
export const scenarios = () => request("/api/scenarios");
export const scenario = (name, signal) => request(`/api/scenarios/${encodeURIComponent(name)}`, { signal });
export const schema = (family) => request(`/api/schemas/${encodeURIComponent(family)}`);
export const edited = (name, set, signal) => request(`/api/scenarios/${encodeURIComponent(name)}/edited`, { method: "POST", body: { set }, signal });
export const saveScenario = (name, scenario) => request(`/api/scenarios/${encodeURIComponent(name)}`, { method: "PUT", body: scenario });
export const importToml = (name, text) => request(`/api/scenarios/${encodeURIComponent(name)}`, { method: "PUT", raw: text, type: "application/toml" });
export const logs = () => request("/api/logs");
export const describeLog = (log) => request(`/api/logs/${encodeURIComponent(log)}`);
export const sendLogFile = (log, name, file) => request(`/api/logs/${encodeURIComponent(log)}/${encodeURIComponent(name)}`, { method: "PUT", raw: file, type: "text/csv" });
export const previewLog = (log, scenario, signal) => request(`/api/logs/${encodeURIComponent(log)}/preview`, { method: "POST", body: { scenario }, signal });
export const removeLog = (log) => request(`/api/logs/${encodeURIComponent(log)}`, { method: "DELETE" });
export const jobs = () => request("/api/jobs");
export const findJob = (id, signal) => request(job(id), { signal });
export const view = (id, signal) => request(`${job(id)}/view`, { signal });
export const result = (id, signal) => request(resultPath(id), { signal });
export const cancel = (id) => request(`${job(id)}/cancel`, { method: "POST" });
export const remove = (id) => request(job(id), { method: "DELETE" });
export const mark = (id, marks) => request(job(id), { method: "PATCH", body: marks });
export const ranScenario = (id, signal) => request(`${job(id)}/scenario`, { signal });
export const resultPath = (id) => `${job(id)}/result`;
export const arraysPath = (id) => `${job(id)}/arrays`;
export const tracksPath = (id) => `${job(id)}/tracks`;
export const reportPath = (id) => `${job(id)}/report`;
export const analyseTracking = (body, signal) => request("/api/tracking/analysis", { method: "POST", body, signal });
export const trackingRegions = (body) => request("/api/tracking/regions", { method: "POST", body });
export const tablePlan = () => request("/api/tables/walls2011-table-1");
export const tableOf = (runs) => request("/api/tables/walls2011-table-1", { method: "POST", body: runs });
export const graph = (id, algorithm) => request(`${job(id)}/graphs/${encodeURIComponent(algorithm)}`);
export const eventsPath = (id) => `${job(id)}/events`;

/** Deletes a job even while the page goes. */
export function removeLast(id) {
  fetch(job(id), { method: "DELETE", keepalive: true });
}

/** Submits a job; the key makes a repeated submission the same job. */
export function submit(body, key) {
  return request("/api/jobs", { method: "POST", body, headers: { "idempotency-key": key } });
}

/** A key that no other submission has. */
export function newKey() {
  return Array.from(crypto.getRandomValues(new Uint8Array(16)), (b) => b.toString(16).padStart(2, "0")).join("");
}
