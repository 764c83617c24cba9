# The demo in a container; its records are in runs/, owned by you:
#   docker build -t humanclaw . && mkdir -p runs
#   docker run --rm --user "$(id -u):$(id -g)" -v "$PWD/runs:/home/humanclaw/runs" humanclaw
# Training tasks for OpenEnv clients, at port 8000:
#   docker build --build-arg EXTRA=openenv -t humanclaw-openenv .
#   docker run --rm -p 8000:8000 humanclaw-openenv openenv --host 0.0.0.0
FROM python:3.12-slim AS wheels
WORKDIR /src
COPY . .
RUN pip install --no-cache-dir hatchling && python tests/support/wheels.py /wheels

FROM python:3.12-slim
ARG EXTRA=demo
RUN --mount=type=bind,from=wheels,source=/wheels,target=/wheels \
    pip install --no-cache-dir --only-binary=:all: --find-links /wheels "humanclaw[$EXTRA]"
RUN useradd --create-home humanclaw && install -d -o humanclaw /home/humanclaw/runs
USER humanclaw
WORKDIR /home/humanclaw
ENV HOME=/home/humanclaw
# Compile the renderer now, so that no container waits for its first picture, whichever user it runs as.
RUN humanclaw run --agent still --max-steps 1 --film none --out /tmp/first && rm -r /tmp/first && chmod -R a+rwX "$HOME"
ENTRYPOINT ["humanclaw"]
CMD ["run", "--instruction", "find a couch and sit on it", "--scene", "house:0"]
