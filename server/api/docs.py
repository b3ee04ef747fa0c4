"""The API's documentation as a plain page: nothing fetched from anywhere."""

from __future__ import annotations

from html import escape
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

router = APIRouter(include_in_schema=False)

STYLE = """
body{font:16px/1.5 system-ui,sans-serif;max-width:60rem;margin:2rem auto;padding:0 1rem;color:#1c2430}
code{background:#eef1f5;padding:.1em .3em;border-radius:3px}h2{margin-top:2rem;text-transform:capitalize}
article{border:1px solid #d5dae1;border-radius:6px;padding:.6rem 1rem;margin:.7rem 0}
article h3{margin:0;font-size:1rem}.method{display:inline-block;min-width:4.2em;font-weight:700;color:#0b5c8a}
table{border-collapse:collapse;margin:.4rem 0}td,th{text-align:left;padding:.15rem .8rem .15rem 0;vertical-align:top}
p{margin:.4rem 0}@media(prefers-color-scheme:dark){body{background:#12171e;color:#dbe2ea}code{background:#222b36}
article{border-color:#33404f}.method{color:#6bb6e0}}
"""


@router.get("/api/docs")
def docs(request: Request) -> HTMLResponse:
    return HTMLResponse(render(request.app.openapi()))


def render(spec: dict[str, Any]) -> str:
    """An OpenAPI document as HTML, grouped by tag."""
    groups: dict[str, list[str]] = {}
    for path, methods in spec["paths"].items():
        for method, operation in methods.items():
            groups.setdefault(operation.get("tags", ["other"])[0], []).append(_operation(path, method, operation, spec))
    title = escape(spec["info"]["title"])
    body = "".join(f"<h2>{escape(tag)}</h2>{''.join(articles)}" for tag, articles in groups.items())
    return (
        f'<!doctype html><html lang="en"><head><meta charset="utf-8"><title>{title} API</title>'
        f'<meta name="viewport" content="width=device-width"><style>{STYLE}</style></head><body>'
        f"<h1>{title} API {escape(spec['info']['version'])}</h1><p>{escape(spec['info'].get('description', ''))}</p>"
        f'<p>For machines: <a href="/api/openapi.json">/api/openapi.json</a> (OpenAPI {escape(spec["openapi"])}).</p>'
        f"{body}</body></html>"
    )


def _operation(path: str, method: str, operation: dict[str, Any], spec: dict[str, Any]) -> str:
    rows = [(p["name"], f"in {p['in']}", _type(p.get("schema", {}), spec)) for p in operation.get("parameters", ())]
    for kind, content in operation.get("requestBody", {}).get("content", {}).items():
        schema = _resolved(content.get("schema", {}), spec)
        required = schema.get("required", ())
        rows += [
            (name, "in body" + (", required" if name in required else ""), _type(value, spec))
            for name, value in schema.get("properties", {}).items()
        ] or [("body", "", kind)]
    table = "".join(
        f"<tr><td><code>{escape(a)}</code></td><td>{escape(b)}</td><td>{escape(c)}</td></tr>" for a, b, c in rows
    )
    answers = ", ".join(code for code in operation.get("responses", {}))
    return (
        f'<article><h3><span class="method">{method.upper()}</span> <code>{escape(path)}</code></h3>'
        f"<p>{escape(operation.get('description') or operation.get('summary', ''))}</p>"
        + (f"<table>{table}</table>" if table else "")
        + f"<p>Answers: {escape(answers)} (errors as problem+json)</p></article>"
    )


def _resolved(schema: dict[str, Any], spec: dict[str, Any]) -> dict[str, Any]:
    reference = schema.get("$ref")
    return spec["components"]["schemas"][reference.rsplit("/", 1)[1]] if reference else schema


def _type(schema: dict[str, Any], spec: dict[str, Any]) -> str:
    schema = _resolved(schema, spec)
    if "anyOf" in schema:
        return " or ".join(_type(s, spec) for s in schema["anyOf"] if s.get("type") != "null")
    kind = schema.get("type", "any")
    if kind == "array":
        kind = f"list of {_type(schema.get('items', {}), spec)}"
    note = schema.get("description")
    return f"{kind}: {note}" if note else str(kind)
