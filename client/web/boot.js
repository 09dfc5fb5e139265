// boot.js - what the page does when one of its modules does not come: says so, and loads itself again.
// No module itself: it has to be there when one of them is not. A server that has no connection free for the
// moment refuses files; browsers do not ask again for them.
(() => {
    const TRIES = "helio-tries"; // in a row, for longer and longer pauses
    const LEAST_S = 2;
    const MOST_S = 30;
    const app = document.querySelector("script[type=module]");
    const tries = Number(sessionStorage.getItem(TRIES) ?? 0);

    let hasFailed = false;
    const fail = () => {
        if (hasFailed)
            return;
        hasFailed = true;
        sessionStorage.setItem(TRIES, String(tries + 1));
        // Those who were refused at once do not all come again at once.
        const wait_s = Math.min(MOST_S, LEAST_S * 2 ** tries) * (0.5 + Math.random());
        document.querySelector("#status .words").textContent = "Not loaded";
        document.querySelector("#status").dataset.state = "lost";
        const curtain = document.querySelector("#curtain");
        const part = (name, text) => {
            const node = document.createElement(name);
            node.textContent = text;
            curtain.append(node);
            return node;
        };
        part("h2", "The page did not come whole");
        part("p", `The server may be busy. Trying again in ${Math.ceil(wait_s)} s.`);
        const again = part("button", "Try now");
        again.className = "button primary";
        again.addEventListener("click", () => location.reload());
        curtain.hidden = false;
        setTimeout(() => location.reload(), wait_s * 1000);
    };

    app.addEventListener("error", fail);
    addEventListener("load", () => {
        if (!document.querySelector("link[rel=stylesheet]").sheet)
            fail();
        if (!hasFailed)
            sessionStorage.removeItem(TRIES);
    });
})();
