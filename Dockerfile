# coupled, with its physics compiled: docker build -t coupled . && docker run --rm coupled compare
#
# The cache is valid on processors like that of the build; on others the first start compiles anew.
# Files: docker run --rm -v "$PWD:/work" coupled diagnose record.csv --rig rig.toml
FROM python:3.13-slim AS wheel
COPY . /source
RUN pip wheel --no-cache-dir --no-deps -w /wheels /source

FROM python:3.13-slim
ENV NUMBA_CACHE_DIR=/opt/coupled/cache MPLCONFIGDIR=/opt/coupled/matplotlib
COPY --from=wheel /wheels /wheels
# --only-binary: every dependency has a wheel, so that no compiler is needed.
RUN pip install --no-cache-dir --only-binary :all: "$(echo /wheels/*.whl)[live,logs]" \
    && rm -r /wheels
WORKDIR /work
# Runs that need all kernels of flights, of their figures and of a diagnosis.
RUN coupled compare \
    && coupled fly three-controls -o record.csv \
    && coupled diagnose record.csv --rig c172p \
    && rm -r /work/* \
    && chmod -R a+rwX /opt/coupled /work
ENTRYPOINT ["coupled"]
CMD ["--help"]
