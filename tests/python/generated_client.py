"""Submits a job with a client that was generated from the OpenAPI document, waits for it and reads its report.

generated_client.py URL FOLDER, where FOLDER holds the package meniscus_client.
"""

import sys
import time

url, folder = sys.argv[1:3]
sys.path.insert(0, folder)

from meniscus_client import Client  # noqa: E402
from meniscus_client.api.jobs import get_job, submit_job  # noqa: E402
from meniscus_client.api.results import job_report  # noqa: E402
from meniscus_client.models import JobSpec  # noqa: E402

client = Client(base_url=url, raise_on_unexpected_status=True)
body = JobSpec.from_dict({"name": "generated", "scene": {"kind": "redistance", "spacing": 0.1, "shape": "circle"}})
refused = submit_job.sync_detailed(client=client, body=body)
assert refused.status_code == 422, "a circle without a radius is refused"
assert refused.parsed.errors[0].pointer == "/scene/shape/radius", refused.parsed

body = JobSpec.from_dict({"name": "generated", "scene": {"kind": "redistance", "spacing": 0.1}})
job = submit_job.sync(client=client, body=body)
deadline = time.monotonic() + 60
while job.state not in ("succeeded", "failed", "canceled"):
    assert time.monotonic() < deadline, job.state
    time.sleep(0.1)
    job = get_job.sync(job.id, client=client)
assert job.state == "succeeded", job.message
report = job_report.sync(job.id, client=client)
errors = {(entry.quantity, entry.norm): entry.value for entry in report.errors}
assert errors["phi", "rms"] < 1e-3, errors
print("the generated client submitted a job and read its report")
