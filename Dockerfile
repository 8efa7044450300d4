# The workbench and the command line in one image; workspaces live in the volume /workspace.
#
#   docker build -t robotrue .
#   docker run --rm -p 127.0.0.1:8080:8080 -e ROBOTRUE_PASSWORD=... -v "$PWD/workspace:/workspace" robotrue
#   docker run --rm -v "$PWD:/workspace" robotrue robotrue calibrate cell.toml calibration.csv -o m.robotrue
FROM python:3.12-slim-bookworm

# Chinese characters in PDF reports.
RUN apt-get update -qq \
    && apt-get install -qq -y --no-install-recommends fonts-noto-cjk \
    && rm -rf /var/lib/apt/lists/*

COPY . /src
RUN pip install --no-cache-dir -c /src/constraints.txt "/src[all]" && rm -rf /src

RUN useradd --create-home robotrue && mkdir /workspace && chown robotrue /workspace
USER robotrue
# Kernels are compiled once for the processor that builds the image, others compile their own.
ENV NUMBA_CACHE_DIR=/home/robotrue/kernels
RUN robotrue warm-up

WORKDIR /workspace
EXPOSE 8080
CMD ["robotrue", "serve", "/workspace", "--host", "0.0.0.0", "--password-env", "ROBOTRUE_PASSWORD"]
