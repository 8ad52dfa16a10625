"""`tcstudy report`: a result file as one HTML page that needs no network, from the stored data alone.

`stored` reads what is kept, `run_part`, `point_part`, `law_part` and `other_part` pick what
the page shows, `container` packs it, `write` puts it together with the scripts in `assets`.
"""

from tcstudy.reports.page.write import LEAVE_OUT, PageError, write_page

__all__ = ["LEAVE_OUT", "PageError", "write_page"]
