# conevo, run by a user without privileges, who writes to /work:
#   docker build -t conevo . && docker run --rm -v "$PWD:/work" conevo run rover/apart-5 --method cone-es
# and all its tests:
#   docker build -t conevo-test --target test . && docker run --rm conevo-test
FROM python:3.11-slim AS package
ENV PYTHONDONTWRITEBYTECODE=1 PIP_NO_CACHE_DIR=1 WARP_CACHE_PATH=/tmp/warp MPLCONFIGDIR=/tmp/matplotlib
RUN useradd --create-home conevo && mkdir /work && chown conevo /work
COPY pyproject.toml README.md LICENSE /src/
COPY src /src/src
RUN pip install /src

FROM package AS test
COPY --chown=conevo . /src
RUN pip install '/src[test]' && chown conevo /src
USER conevo
WORKDIR /src
CMD ["pytest", "-n", "2"]

FROM package
USER conevo
WORKDIR /work
ENTRYPOINT ["conevo"]
CMD ["--help"]
