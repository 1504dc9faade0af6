"""A page in headless Chromium, and what a person does with it: what page_test.py and report_page_test.py share, with the
arguments that page_test.py is called with. Leaves with 77 where there is no Chromium."""
import json
import pathlib
import shutil
import sys
import time
import unittest

SIGHTLINED, SIGHTLINE, MAKE_SCENES, MAKE_RECORDING, READER, OUT = sys.argv[1:7]
OUT = pathlib.Path(OUT)
PATIENCE_S = 60  # software WebGL on a machine that does other things as well

CHROMIUM, DRIVER = shutil.which("chromium"), shutil.which("chromedriver")
try:
    from selenium import webdriver
    from selenium.webdriver.chrome.options import Options
    from selenium.webdriver.chrome.service import Service
    from selenium.webdriver.common.action_chains import ActionChains
    from selenium.webdriver.common.by import By
    from selenium.webdriver.common.keys import Keys
except ImportError:
    webdriver = None
if not (CHROMIUM and DRIVER and webdriver):
    print("skipped: needs the packages chromium, chromium-driver and python3-selenium")
    sys.exit(77)


def wait_for(what, patience_s=PATIENCE_S):
    """The first true value of `what()`."""
    end = time.monotonic() + patience_s
    while True:
        value = what()
        if value:
            return value
        if time.monotonic() > end:
            raise AssertionError("waited in vain")
        time.sleep(0.05)


def browser(width, height, light=False, flags=()):
    options = Options()
    options.binary_location = CHROMIUM
    for flag in ("--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-quic",
                 "--no-first-run", "--disable-background-networking", "--disable-component-update", "--disable-sync",
                 "--disable-dev-shm-usage", *flags):
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
    driver = webdriver.Chrome(service=Service(DRIVER), options=options)
    driver.set_script_timeout(PATIENCE_S)
    driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                           {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False})
    prefer(driver, light)
    return driver


def prefer(driver, light):
    driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {
        "features": [{"name": "prefers-color-scheme", "value": "light" if light else "dark"}]})


class Browsing(unittest.TestCase):
    """A page, and what a person does with it."""
    page = None

    @classmethod
    def setUpClass(cls):
        cls.driver = browser(1280, 800)

    @classmethod
    def tearDownClass(cls):
        cls.driver.quit()

    def setUp(self):
        self.open()

    def tearDown(self):
        self.assert_quiet()

    # ---- what a person does ----

    def open(self, address=""):
        self.driver.get("about:blank")
        self.driver.get_log("browser"), self.driver.get_log("performance")
        self.driver.get(f"file://{self.page}{address}")
        wait_for(lambda: self.driver.execute_script("return document.body.dataset.ready"))
        self.rest()

    def go(self, frame):
        self.driver.execute_script("window.location.hash = `frame=${arguments[0]}`", frame)
        wait_for(lambda: self.frame() == frame)
        self.rest()

    def rest(self):
        """Until all that was asked for is drawn."""
        self.driver.execute_async_script(
            "const done = arguments[0]; requestAnimationFrame(() => requestAnimationFrame(() => done()))")

    def find(self, selector):
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    def press(self, *keys):
        ActionChains(self.driver).send_keys(*keys).perform()
        self.rest()

    def press_with_shift(self, key):
        ActionChains(self.driver).key_down(Keys.SHIFT).send_keys(key).key_up(Keys.SHIFT).perform()
        self.rest()

    def click_at(self, element, x, y):
        """Pixels from the element's upper left corner."""
        box = element.rect
        ActionChains(self.driver).move_to_element_with_offset(
            element, round(x - box["width"] / 2), round(y - box["height"] / 2)).click().perform()
        self.rest()

    # ---- what the page shows ----

    def text(self, field):
        return self.find(f'[data-field="{field}"]').get_attribute("textContent")

    def frame(self):
        return int(self.text("frame").split(" of ")[0])

    def view(self):
        return self.driver.execute_script("return window.sightline.view.state()")

    def picture(self, selector="#view"):
        return self.find(selector).screenshot_as_base64

    def colours_at(self, picture, points):
        """Red, green, blue at pixels of a screenshot, decoded by the browser."""
        return self.driver.execute_async_script("""
            const [url, points, done] = arguments, image = new Image();
            image.onload = () => {
              const canvas = document.createElement('canvas');
              [canvas.width, canvas.height] = [image.width, image.height];
              const context = canvas.getContext('2d', { willReadFrequently: true });
              context.drawImage(image, 0, 0);
              done(points.map(([x, y]) => [...context.getImageData(x, y, 1, 1).data].slice(0, 3)));
            };
            image.src = url;""", f"data:image/png;base64,{picture}", points)

    def assert_quiet(self):
        """No message of the console, and no request but for the file itself and what it holds."""
        wrong = [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")
                 and "GPU stall" not in entry["message"]]  # software rendering says so of a screenshot
        self.assertEqual(wrong, [])
        for entry in self.driver.get_log("performance"):
            message = json.loads(entry["message"])["message"]
            if message["method"] == "Network.requestWillBeSent":
                url = message["params"]["request"]["url"]
                self.assertTrue(url.startswith(("data:", "about:", f"file://{self.page}")), url[:200])
