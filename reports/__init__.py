"""From finished records to a page that opens from disk.

Reports read records, scores and images; they never render.
"""

from reports.page import write_report

__all__ = ["write_report"]
