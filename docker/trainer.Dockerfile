# The trainer: torch, without fmpy, Dask and numba. It reads a finished dataset and needs no network.
#
#     docker build -f docker/trainer.Dockerfile -t zeroshot-trainer --build-arg PIP_INDEX=ADDRESS .
#
# Run it in the project's root. Without PIP_INDEX pip may take a torch build with gigabytes of CUDA; ADDRESS is that of
# the index of CPU wheels, which torch's installation page gives.
ARG PYTHON=3.11.14-slim-bookworm

FROM python:${PYTHON} AS build
ARG PIP_INDEX
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore
WORKDIR /source
# the dependencies first, for a distribution that is still empty: they stay in Docker's cache when our code changes
COPY LICENSE README.md constraints.txt pyproject.toml ./
RUN python -m venv --without-pip /opt/zeroshot \
    && pip --python /opt/zeroshot/bin/python install ${PIP_INDEX:+--extra-index-url "$PIP_INDEX"} \
    --constraint constraints.txt '.[trainer]'
COPY shared shared
COPY datagen datagen
COPY trainer trainer
COPY diagnosis diagnosis
COPY fmus fmus
RUN pip wheel --no-deps --wheel-dir /wheels . \
    && pip --python /opt/zeroshot/bin/python install --no-deps --force-reinstall /wheels/*.whl
# the packages' own tests, which nobody runs in an image, and torch's C++ tests and headers, which want a compiler
RUN find /opt/zeroshot/lib -depth -type d -name tests -path '*/site-packages/*' -exec rm -rf '{}' + \
    && rm -rf /opt/zeroshot/lib/python*/site-packages/torch/test /opt/zeroshot/lib/python*/site-packages/torch/include

FROM python:${PYTHON}
COPY --from=build /opt/zeroshot /opt/zeroshot
RUN groupadd --gid 10001 zeroshot \
    && useradd --uid 10001 --gid 10001 --no-create-home --home-dir /tmp --shell /usr/sbin/nologin zeroshot \
    && install --directory --owner=10001 --group=10001 /data /runs
# the root may be read-only: only /runs and /tmp are written to; LOGNAME for those who start it under another uid
ENV PATH=/opt/zeroshot/bin:$PATH \
    HOME=/tmp \
    LOGNAME=zeroshot \
    MPLCONFIGDIR=/tmp/matplotlib \
    OMP_NUM_THREADS=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1
USER 10001:10001
WORKDIR /runs
# what trainer takes for Ctrl-C: `fit --resume` goes on from the last state
STOPSIGNAL SIGINT
HEALTHCHECK --interval=5m --timeout=60s --start-period=60s CMD ["trainer", "--version"]
ENTRYPOINT ["trainer"]
CMD ["--help"]
