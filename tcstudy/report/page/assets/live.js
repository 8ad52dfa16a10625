TC.live = { draw() {} };
