"""The part of the page of CONTRIBUTING: a button that shows how many clients the server has."""

from tests.panel.pages import opened, shows


def test_the_button_shows_the_number_of_clients(chromium, panel):
    with opened(chromium, panel.url) as page:
        page.locator("#tab-view").click()
        page.locator("#clients").click()
        shows(page, "clients-count", "^1$")
