# Two stages: the first has the build backend and makes the environment, the second has only what runs.

# The digest is that of the multi-platform index that python:3.11-slim-trixie named in August 2026. To take a newer image,
# run `docker buildx imagetools inspect python:3.11-slim-trixie` and put its digest here.
ARG BASE=python:3.11-slim-trixie@sha256:9c900dea9e8fb7e16277c179b555cc72d29a352dbc33cff48ad5a0412fd5bfc7

FROM ${BASE} AS build
WORKDIR /src
COPY requirements.lock requirements-build.lock ./
RUN python -m venv /opt/urquhart \
    && /opt/urquhart/bin/pip install --no-cache-dir --no-deps --require-hashes -r requirements.lock
RUN python -m venv /opt/build \
    && /opt/build/bin/pip install --no-cache-dir --no-deps --require-hashes -r requirements-build.lock
COPY . .
RUN /opt/build/bin/pip wheel --no-build-isolation --no-deps --wheel-dir /wheels . clients/python \
    && /opt/urquhart/bin/pip install --no-cache-dir --no-deps /wheels/*.whl
# For any processor of the platform, because the image may run on another one than it is built on.
RUN NUMBA_CACHE_DIR=/opt/urquhart/kernels NUMBA_CPU_NAME=generic /opt/urquhart/bin/urquhart warm

FROM ${BASE}
RUN useradd --system --uid 10001 --user-group --home-dir /var/lib/urquhart --create-home urquhart
COPY --from=build /opt/urquhart /opt/urquhart
# The kernels are compiled already; the folder is only read.
ENV PATH=/opt/urquhart/bin:$PATH \
    PYTHONUNBUFFERED=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    NUMBA_CACHE_DIR=/opt/urquhart/kernels \
    NUMBA_CPU_NAME=generic \
    URQUHART_DATABASE=/var/lib/urquhart/urquhart.db
USER urquhart
WORKDIR /var/lib/urquhart
VOLUME /var/lib/urquhart
EXPOSE 8420
STOPSIGNAL SIGTERM
HEALTHCHECK --interval=10s --timeout=5s --start-period=120s --retries=3 \
    CMD ["python", "-c", "import sys, urllib.request as r; sys.exit(r.urlopen('http://127.0.0.1:8420/readyz', timeout=4).status != 200)"]
# Inside a container the service must listen on every address; who may reach it is decided where the port is published
# (docker-compose.yml: on the host's loopback only).
# Without a key it refuses to start there, unless URQUHART_INSECURE is set: docs/deploy.md says how to make one.
CMD ["urquhart", "serve", "--host", "0.0.0.0", "--port", "8420"]
