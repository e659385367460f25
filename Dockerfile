# Written, but not built or run by the tests of this repository. In a folder with jobs:
#   docker build -t holokin REPOSITORY
#   docker run --rm --user "$(id -u)" -v "$PWD:/work" holokin run my-job.toml
FROM python:3.13-slim
RUN apt-get update && apt-get install --yes --no-install-recommends gcc libc6-dev && rm -rf /var/lib/apt/lists/*
COPY pyproject.toml README.md LICENSE /src/
COPY src /src/src
RUN pip install --no-cache-dir "/src[app,log,proof]" && rm -rf /src
ENV HOME=/tmp
USER 1000
WORKDIR /work
ENTRYPOINT ["holokin"]
CMD ["--help"]
