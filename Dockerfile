# Sightline's daemon as a sidecar image.
#
#   docker build -t sightline .                                  without OpenGL
#   docker build -t sightline:gpu --target gpu .                 with OpenGL, which is slower on every machine measured
#   docker run --rm -v sightline-socket:/run/sightline sightline
#   docker run --rm --user "$(id -u)" -v "$PWD:/out" sightline demo --out /out/demo
#
# The daemon listens at the unix socket /run/sightline/sightline.sock, in a volume that it shares with the game server. Port 50152 serves
# metrics and probes. deploy/README.md says how to use TCP instead. The last line plays a generated scene and leaves the page of the session
# in ./demo. /scenes holds two scenes, hall.glb and rooms.glb, until a folder is mounted over it.
#
# The image "gpu" uses a GPU when the daemon is started with --require-gpu; it then refuses to start on a node that has lost its GPU. Run it with the
# NVIDIA container toolkit (--gpus all, NVIDIA_DRIVER_CAPABILITIES=graphics), which mounts the vendor's EGL next to Mesa's. For AMD and
# Intel, pass --device /dev/dri.

# The base of all stages. deploy/README.md says how to give it with a digest, so that a later build starts from the same one.
ARG BASE=debian:bookworm-slim

FROM ${BASE} AS build
COPY deploy/install-packages.sh /src/deploy/install-packages.sh
RUN /src/deploy/install-packages.sh build
COPY . /src
# Compiled objects are kept between builds of the image, so a second one takes a few minutes.
RUN --mount=type=cache,id=sightline-ccache,target=/var/cache/ccache \
    export LANG=C.UTF-8 CCACHE_DIR=/var/cache/ccache CCACHE_BASEDIR=/src CCACHE_NOHASHDIR=1 \
 && cmake -S /src -B /src/build/image -G Ninja -DCMAKE_BUILD_TYPE=Release -DSIGHTLINE_TESTS=OFF \
 && cmake --build /src/build/image --target sightlined sightline make-scenes third_parties \
 && install -d /build \
 && mv /src/build/image/bin /src/build/image/third-parties.txt /build/ \
 && /build/bin/make-scenes --out /build/scenes hall rooms \
 && strip /build/bin/sightlined /build/bin/sightline

# With OpenGL: the packages that it runs with.
FROM ${BASE} AS gpu-system
COPY deploy/install-packages.sh /tmp/install-packages.sh
RUN /tmp/install-packages.sh run \
 && rm -rf /tmp/install-packages.sh /var/lib/apt/lists/* /var/cache/* /var/log/* \
 && install -d -o 65532 -g 65532 /run/sightline

# The bill of materials of the image "gpu". The stage that has the sources makes it, from what dpkg knows of the stage above. BuildKit passes on
# SOURCE_DATE_EPOCH where it is set.
FROM build AS gpu-sbom
ARG SOURCE_DATE_EPOCH
COPY --from=gpu-system /var/lib/dpkg /image/var/lib/dpkg
COPY --from=gpu-system /usr/share/doc /image/usr/share/doc
COPY --from=gpu-system /usr/lib/os-release /image/usr/lib/os-release
RUN python3 /src/deploy/packages/sbom.py /src/build/image /src /build/sbom.spdx.json /build/bin/sightlined /build/bin/sightline \
            --root /image --name sightline-gpu --optional libegl1,libopengl0,libegl-mesa0,libgl1-mesa-dri

FROM gpu-system AS gpu
COPY --from=build /build/scenes /scenes
COPY --from=build /build/third-parties.txt /usr/share/doc/sightline/
COPY --from=gpu-sbom /build/sbom.spdx.json /usr/share/doc/sightline/
COPY --from=build /build/bin/sightlined /build/bin/sightline /usr/local/bin/
# 65532 is the user "nonroot" of other images; a number needs no entry in /etc/passwd. The daemon writes nothing at run time but its socket,
# so the image works with a read-only root, without capabilities and without a home folder.
USER 65532:65532
VOLUME /run/sightline
EXPOSE 50152
ENTRYPOINT ["sightlined"]
CMD ["--listen", "none", "--listen-unix", "/run/sightline/sightline.sock", "--metrics-listen", "0.0.0.0:50152", "--scene-dir", "/scenes", "--log-format", "json"]

# Without OpenGL.
FROM ${BASE} AS cpu-system
COPY deploy/install-packages.sh /tmp/install-packages.sh
RUN /tmp/install-packages.sh run-cpu \
 && rm -rf /tmp/install-packages.sh /var/lib/apt/lists/* /var/cache/* /var/log/* \
 && install -d -o 65532 -g 65532 /run/sightline

FROM build AS cpu-sbom
ARG SOURCE_DATE_EPOCH
COPY --from=cpu-system /var/lib/dpkg /image/var/lib/dpkg
COPY --from=cpu-system /usr/share/doc /image/usr/share/doc
COPY --from=cpu-system /usr/lib/os-release /image/usr/lib/os-release
RUN python3 /src/deploy/packages/sbom.py /src/build/image /src /build/sbom.spdx.json /build/bin/sightlined /build/bin/sightline \
            --root /image --name sightline-cpu

# The last stage is the one that is built when none is named.
FROM cpu-system AS cpu
COPY --from=build /build/scenes /scenes
COPY --from=build /build/third-parties.txt /usr/share/doc/sightline/
COPY --from=cpu-sbom /build/sbom.spdx.json /usr/share/doc/sightline/
COPY --from=build /build/bin/sightlined /build/bin/sightline /usr/local/bin/
USER 65532:65532
VOLUME /run/sightline
EXPOSE 50152
ENTRYPOINT ["sightlined"]
CMD ["--listen", "none", "--listen-unix", "/run/sightline/sightline.sock", "--metrics-listen", "0.0.0.0:50152", "--scene-dir", "/scenes", "--log-format", "json"]
