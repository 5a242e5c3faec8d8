"""Somebody at the pages of a golf swing."""

from page_driver import Person


class Golfer(Person):
    """A person who clicks in the picture of the page that is open."""

    def on_screen(self, place):
        view = self.page.get_attribute("body", "data-view")
        picture = "#picture" if view == "keyframes" else f"#{view}-picture"
        scale, x, y = map(float, self.page.get_attribute(picture, "data-view").split())
        box = self.page.locator(picture).bounding_box()
        return box["x"] + scale * place[0] + x, box["y"] + scale * place[1] + y

    def await_frame(self, view, frame):
        self.page.wait_for_selector(f"#{view}-picture[data-frame='{frame}']")
        self.await_text(f"#{view}-where", rf"frame {frame} of")
        self.await_drawn()
