# Sightline's daemon as a sidecar image.
#
#   docker build -t sightline .
#   docker run --rm -p 127.0.0.1:50151:50151 -v "$PWD/my-scenes:/scenes:ro" sightline
#   docker run --rm --user "$(id -u)" -v "$PWD:/out" sightline demo --out /out/demo
#
# The last line plays a generated scene and leaves the page of the session in ./demo. /scenes holds two scenes, hall.glb and rooms.glb, until a folder
# is mounted over it.
#
# Inside the container the daemon listens on all interfaces, because a published port cannot reach the container's loopback. Everyone who
# reaches the port may speak, so publish it on the host's loopback only, as above. As a sidecar that shares the network of its pod, give
# it --listen 127.0.0.1:50151 instead. To serve other hosts, give it --listen with --tls-cert, --tls-key and --access-file
# (deploy/SECURITY.md).
#
# Without a GPU the daemon uses Embree on the CPU. On a node with a GPU, run the image with the NVIDIA container toolkit
# (--gpus all, NVIDIA_DRIVER_CAPABILITIES=graphics), which mounts the vendor's EGL next to Mesa's. For AMD and Intel, pass
# --device /dev/dri. Add --require-gpu so that the daemon refuses to start on a node that has lost its GPU.

FROM debian:bookworm-slim AS build
COPY deploy/install-packages.sh /src/deploy/install-packages.sh
RUN /src/deploy/install-packages.sh build
COPY . /src
RUN cmake -S /src -B /build -G Ninja -DCMAKE_BUILD_TYPE=Release -DSIGHTLINE_TESTS=OFF \
 && cmake --build /build --target sightlined sightline make-scenes third_parties \
 && /build/bin/make-scenes --out /build/scenes hall rooms \
 && strip /build/bin/sightlined /build/bin/sightline

FROM debian:bookworm-slim
COPY deploy/install-packages.sh /tmp/install-packages.sh
RUN /tmp/install-packages.sh run \
 && rm -rf /tmp/install-packages.sh /var/lib/apt/lists/* /var/cache/apt/* /var/log/apt /var/log/dpkg.log
COPY --from=build /build/scenes /scenes
COPY --from=build /build/third-parties.txt /usr/share/doc/sightline/
COPY --from=build /build/bin/sightlined /build/bin/sightline /usr/local/bin/
# 65532 is the user "nonroot" of other images; a number needs no entry in /etc/passwd. The daemon writes nothing at run time, so the
# image works with a read-only root, without capabilities and without a home folder.
USER 65532:65532
EXPOSE 50151
ENTRYPOINT ["sightlined"]
CMD ["--listen", "0.0.0.0:50151", "--allow-insecure-network", "--scene-dir", "/scenes", "--log-format", "json"]
