"""Whatever a request is made of, as the OpenAPI document has it or not: the server answers and does not fail."""

from __future__ import annotations

from typing import Any

import pytest
from fastapi import FastAPI
from fastapi.testclient import TestClient
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from planlang.files import Bundled
from planlang.knowledge.sqlite_store import SqliteStore
from tests.support.examples import some

schemathesis = pytest.importorskip("schemathesis")
NOW = "2026-01-01T00:00:00Z"
schemathesis.serializer("application/sparql-query")(lambda _, value: str(value).encode(errors="replace"))
RECIPE = Bundled.RECIPE.find("serve_a_drink").read_bytes()


@pytest.mark.long
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("mode", some(schemathesis.GenerationMode), ids=lambda mode: mode.value)
def test_no_request_makes_the_server_fail(app: FastAPI, store: SqliteStore, client: TestClient, mode: Any) -> None:
    client.post("/v1/recipes", params={"name": "ward"}, content=RECIPE)
    schema = schemathesis.openapi.from_asgi("/openapi.json", app)
    headers = {"Authorization": f"Bearer {store.new_key('ada', NOW)}"}
    operations = [found.ok() for found in schema.get_all_operations()]
    assert {one.method.upper() for one in operations} == {"GET", "POST", "PUT", "DELETE"}
    for operation in operations:
        if not list(operation.iter_parameters()) and not operation.body:
            continue  # there is nothing to vary

        @settings(max_examples=15, deadline=None, database=None, suppress_health_check=list(HealthCheck))
        @given(operation.as_strategy(generation_mode=mode), st.booleans())
        def answered(case: Any, is_known: bool) -> None:
            if is_known and "uid" in (case.path_parameters or {}):
                case.path_parameters |= {"uid": "serveadrink.ward", "kind": "recipes"}
            response = case.call(headers=headers)
            assert response.status_code < 500, (case.method, case.path, response.text)
            if response.status_code >= 400:
                assert response.headers["content-type"] == ["application/problem+json"]
                assert response.json()["status"] == response.status_code

        answered()
