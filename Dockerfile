# Sightline's daemon as a sidecar image.
#
#   docker build -t sightline .
#   docker run --rm -p 127.0.0.1:50151:50151 -v "$PWD/my-scenes:/scenes:ro" sightline
#
# It runs anywhere: without a GPU it takes Embree's rays on the CPU. On a node with a GPU: run it with the NVIDIA
# container toolkit (--gpus all, NVIDIA_DRIVER_CAPABILITIES=graphics), which mounts the vendor's EGL beside Mesa's, or pass
# --device /dev/dri for AMD and Intel; add --require-gpu so that a node that lost its GPU says so instead of falling
# back to software.

FROM debian:bookworm-slim AS build
COPY deploy/install-packages.sh /src/deploy/install-packages.sh
RUN /src/deploy/install-packages.sh build
COPY . /src
RUN cmake -S /src -B /build -G Ninja -DCMAKE_BUILD_TYPE=Release -DSIGHTLINE_TESTS=OFF \
 && cmake --build /build --target sightlined sightline \
 && strip /build/bin/sightlined /build/bin/sightline

FROM debian:bookworm-slim
COPY deploy/install-packages.sh /tmp/install-packages.sh
RUN /tmp/install-packages.sh run \
 && rm -rf /tmp/install-packages.sh /var/lib/apt/lists/* /var/cache/apt/* /var/log/apt /var/log/dpkg.log \
 && mkdir /scenes
COPY --from=build /build/bin/sightlined /build/bin/sightline /usr/local/bin/
# No name is needed for a number; 65532 is what "nonroot" is elsewhere. Nothing is written at run time: the image works
# with a read-only root, no capabilities and no home.
USER 65532:65532
EXPOSE 50151
ENTRYPOINT ["sightlined"]
CMD ["--listen", "0.0.0.0:50151", "--scene-dir", "/scenes", "--log-format", "json"]
