"""A thin client of the Meniscus simulation service.

>>> from meniscus_client import Meniscus
>>> service = Meniscus("http://127.0.0.1:8080")
>>> job = service.submit({"scene": {"kind": "vortex"}})
>>> job.wait()
>>> job.series()          # a pandas DataFrame
>>> job.frame().fields    # NumPy arrays by name
"""

from .client import Ended, Job, Meniscus, Refused, Study, Upload
from .frames import Frame

__all__ = ["Ended", "Frame", "Job", "Meniscus", "Refused", "Study", "Upload"]
