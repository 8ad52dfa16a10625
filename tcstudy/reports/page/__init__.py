"""`tcstudy report`: a result file as one HTML page that needs no network, from the stored data alone.

`stored` reads what is kept, `run_part`, `line_part`, `body_part`, `law_part`, `live_part` and `other_kinds` pick what
the page shows, `container` packs it, `write` puts it together with the scripts in `assets`.
"""

from tcstudy.reports.page.write import LEAVE_OUT, PageError, write_page

__all__ = ["LEAVE_OUT", "PageError", "write_page"]
