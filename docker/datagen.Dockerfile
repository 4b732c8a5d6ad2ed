# The simulation farm: Dask's scheduler, its workers, and `datagen`. Without torch, without a compiler.
#
#     docker build -f docker/datagen.Dockerfile -t zeroshot-datagen .
#
# Run it in the project's root. --build-arg PIP_INDEX=ADDRESS names a further package index, where a site has one.
ARG PYTHON=3.11.14-slim-bookworm

FROM python:${PYTHON} AS build
ARG PIP_INDEX
ENV PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1 PIP_ROOT_USER_ACTION=ignore
WORKDIR /source
# the dependencies first, for a distribution that is still empty: they stay in Docker's cache when our code changes;
# without the cmake that fmpy brings to compile FMUs that come as source: an image needs no build tool
COPY LICENSE README.md constraints.txt pyproject.toml ./
RUN python -m venv --without-pip /opt/zeroshot \
    && pip --python /opt/zeroshot/bin/python install ${PIP_INDEX:+--extra-index-url "$PIP_INDEX"} \
    --constraint constraints.txt '.[datagen]' \
    && pip --python /opt/zeroshot/bin/python uninstall --yes cmake
COPY shared shared
COPY datagen datagen
COPY trainer trainer
COPY diagnosis diagnosis
COPY fmus fmus
RUN pip wheel --no-deps --wheel-dir /wheels . \
    && pip --python /opt/zeroshot/bin/python install --no-deps --force-reinstall /wheels/*.whl
# the packages' own tests; numba, scipy and their kin bring many, and nobody runs them in an image
RUN find /opt/zeroshot/lib -depth -type d -name tests -path '*/site-packages/*' -exec rm -rf '{}' +
# the packaged systems under a name that does not depend on Python's version
RUN ln -s "$(/opt/zeroshot/bin/python -c 'import fmus; print(fmus.__path__[0])')" /opt/zeroshot/systems

FROM python:${PYTHON}
COPY --from=build /opt/zeroshot /opt/zeroshot
RUN groupadd --gid 10001 zeroshot \
    && useradd --uid 10001 --gid 10001 --no-create-home --home-dir /tmp --shell /usr/sbin/nologin zeroshot \
    && install --directory --owner=10001 --group=10001 /data \
    && install --directory /systems \
    && ln -s /opt/zeroshot/systems/MixedAirCO2 /systems/MixedAirCO2
# the only folder written to beside /data is /tmp: the root may be read-only, but /tmp must allow libraries to be loaded
# (an FMU is unpacked there); LOGNAME for those who start the image under another uid
ENV PATH=/opt/zeroshot/bin:$PATH \
    HOME=/tmp \
    LOGNAME=zeroshot \
    NUMBA_CACHE_DIR=/tmp/numba \
    OMP_NUM_THREADS=1 \
    PYTHONDONTWRITEBYTECODE=1 \
    PYTHONUNBUFFERED=1
USER 10001:10001
WORKDIR /data
# what datagen takes for Ctrl-C: it leaves a dataset that the same command goes on with
STOPSIGNAL SIGINT
# for a job, whether the command still starts; the compose file asks scheduler and workers themselves
HEALTHCHECK --interval=5m --timeout=30s --start-period=30s CMD ["datagen", "--version"]
ENTRYPOINT ["datagen"]
CMD ["--help"]
