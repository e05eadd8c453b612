"""The scope that each operation needs, by its id; None if it needs no key."""

from collections.abc import Mapping
from typing import Final

from server.security.principal import Scope

SCOPES: Final[Mapping[str, Scope | None]] = {
    "getLandingPage": None,
    "getProblem": None,
    "getLiveness": None,
    "getReadiness": None,
    "getMetrics": Scope.READ,
    "getLimits": Scope.READ,
    "listCollections": Scope.READ,
    "getCollection": Scope.READ,
    "putCollection": Scope.ADMIN,
    "patchCollection": Scope.ADMIN,
    "deleteCollection": Scope.ADMIN,
    "listSubmaps": Scope.READ,
    "getSubmap": Scope.READ,
    "getTessellation": Scope.READ,
    "getExport": Scope.READ,
    "getFeaturesLandingPage": Scope.READ,
    "getConformance": Scope.READ,
    "listFeatureCollections": Scope.READ,
    "getFeatureCollection": Scope.READ,
    "listFeatures": Scope.READ,
    "getFeature": Scope.READ,
    "listSessions": Scope.READ,
    "listStands": Scope.READ,
    "getStand": Scope.READ,
    "deleteStand": Scope.WRITE,
    "putStand": Scope.WRITE,
    "readStemMap": Scope.READ,
    "putSubmap": Scope.WRITE,
    "postSubmap": Scope.WRITE,
    "patchSubmap": Scope.WRITE,
    "deleteSubmap": Scope.WRITE,
    "postImport": Scope.WRITE,
    "postReindex": Scope.ADMIN,
    "postConstraints": Scope.READ,
    "postMap": Scope.WRITE,
    "postPoses": Scope.WRITE,
    "getMap": Scope.READ,
    "getMapLandmarks": Scope.READ,
    "listJobs": Scope.READ,
    "getJob": Scope.READ,
    "getJobResults": Scope.READ,
    "getJobErrors": Scope.READ,
    "deleteJob": Scope.WRITE,
    "query": Scope.READ,
    "queryBatch": Scope.READ,
    "getQuery": Scope.READ,
    "getMatch": Scope.READ,
    "getExplanation": Scope.READ,
    "postSnapshot": Scope.ADMIN,
    "listSnapshots": Scope.ADMIN,
    "getSnapshot": Scope.ADMIN,
    "deleteSnapshot": Scope.ADMIN,
}

ALSO: Final[Mapping[str, frozenset[Scope]]] = {"deleteJob": frozenset({Scope.READ, Scope.ADMIN})}
"""Additional scopes that open an operation, which then checks ownership itself: a job may be the caller's own."""
